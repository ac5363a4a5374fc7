# SPDX-License-Identifier: Apache-2.0
"""Each check passes on a sound run and fails on a run that violates it."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from rclpy.serialization import serialize_message
from rehearsed import DIAGNOSTICS, MOTION, WRENCH, Tamper, record, reference, scenario_values

from noninteract_ros.errors import RecordingError
from noninteract_ros.nodes.messages.messages import (
    Level,
    SubtaskCodec,
    to_diagnostics,
    to_status,
    to_wrench_stamped,
)
from noninteract_ros.reporting.checks.checks import Check
from noninteract_ros.reporting.recording.recorded import Recorded
from noninteract_ros.reporting.recording.writer import RunWriter
from noninteract_ros.reporting.rehearsed.rehearsals import source_starts
from noninteract_ros.reporting.report.metrics import Findings, measure
from noninteract_ros.scenario.files import find_scenario, load_scenario


def findings(folder: Path, tamper: Tamper | None = None, **changes: object) -> Findings:
    run = record(folder, scenario_values(**changes), 1.2, tamper)
    return measure(Recorded(run), other_laws=False)


def checks(found: Findings) -> dict[str, Check]:
    return {check.name: check for check in found.checks}


def test_a_sound_run_passes_everything(tmp_path: Path) -> None:
    """No tick is missing, nodes reproduce the rehearsal, subtasks are decoupled."""
    found = findings(tmp_path)
    failed = [check for check in found.checks if check.passed is False]
    assert not failed
    inapplicable = {check.name for check in found.checks if check.passed is None}
    assert inapplicable == {
        "storage_growth.cooperative",
        "storage_growth.relative",
        "recorder_lost",
    }
    assert found.metrics["completeness"]["ticks"] == 600
    assert found.metrics["reproduction"]["bit_equal"]
    assert found.metrics["noninteraction"]["without_human"]["moved"]["cooperative"]["m"] > 0.1
    assert found.metrics["run"]["external_influences"] == []


def test_tracking_is_measured_from_the_first_reference_on(tmp_path: Path) -> None:
    """The error before the first reference does not count."""
    tracking = findings(tmp_path).metrics["tracking"]
    assert tracking["cooperative"]["led_from_s"] == 0.5
    expected = np.hypot(2 * np.sin(0.79 * 0.5), 1.0)
    assert tracking["cooperative"]["initial_error_m"] == pytest.approx(expected, rel=1e-2)
    assert tracking["relative"]["initial_error_m"] == pytest.approx(np.hypot(0.4, 0.2))
    assert tracking["relative"]["final_error_m"] < 0.1 * tracking["relative"]["max_error_m"]


def lose(topic: str, time: float, arrays: list[np.ndarray]) -> list[np.ndarray] | None:
    return None if topic == "joint_states" and 0.2 < time < 0.21 else arrays


def lose_commands(topic: str, time: float, arrays: list[np.ndarray]) -> list[np.ndarray] | None:
    return None if topic == "joint_commands" and 0.2 < time < 0.21 else arrays


def nudge(topic: str, time: float, arrays: list[np.ndarray]) -> list[np.ndarray]:
    if topic == "joint_states" and time > 0.7:
        arrays[0] = arrays[0] + [1e-8, 0.0, 0.0, 0.0]
    return arrays


def negative(topic: str, time: float, arrays: list[np.ndarray]) -> list[np.ndarray]:
    if topic == "relative/energy" and time > 1.0:
        arrays[0][1] -= 1.0
    return arrays


def not_a_number(topic: str, time: float, arrays: list[np.ndarray]) -> list[np.ndarray]:
    if topic == "joint_states" and time == 0.3:
        arrays[0] = arrays[0] * np.nan
    return arrays


def pumped(topic: str, time: float, arrays: list[np.ndarray]) -> list[np.ndarray]:
    if topic == "relative/energy":
        arrays[0][1] += 0.5 * time
    return arrays


@pytest.mark.parametrize(
    ("tamper", "names"),
    [
        (lose, ["complete.ticks_missing", "complete.commands_without_state"]),
        (lose_commands, ["complete.states_unanswered"]),
        (nudge, ["reproduction", "noninteraction.human", "noninteraction.autonomy"]),
        (negative, ["storage_positive.relative"]),
        (not_a_number, ["complete.numbers_not_finite", "reproduction", "closed_form.relative"]),
        (pumped, ["storage_rate.relative", "storage_passive.relative"]),
    ],
)
def test_a_violation_fails_its_check(tmp_path: Path, tamper: Tamper, names: list[str]) -> None:
    """Lost messages, changed states and generated energy fail the checks of their name."""
    found = checks(findings(tmp_path, tamper))
    assert [name for name in names if found[name].passed is not False] == []


def test_storage_without_disturbance_never_grows(tmp_path: Path) -> None:
    """Without object and with references at rest the check applies, passes, and can fail."""
    quiet = {"object": None, "haptic__motion": "still", "haptic__centre": [0.5, 0.2]}
    sound = checks(findings(tmp_path, **quiet))
    assert sound["storage_growth.relative"].passed
    assert sound["storage_growth.cooperative"].passed

    def grow(topic: str, time: float, arrays: list[np.ndarray]) -> list[np.ndarray]:
        if topic == "relative/energy" and time > 0.6:
            arrays[0][1] += 0.5
        return arrays

    broken = checks(findings(tmp_path, grow, **quiet))
    assert broken["storage_growth.relative"].passed is False


def test_the_natural_law_couples_errors(tmp_path: Path) -> None:
    """The comparison shows it; checks of decoupling do not apply."""
    run = record(tmp_path, scenario_values(law="natural"), 1.2)
    found = measure(Recorded(run))
    by_name = checks(found)
    for name in ("noninteraction.human", "closed_form.relative", "storage_growth.relative"):
        assert by_name[name].passed is None
        assert "natural" in by_name[name].reason
    # The energy exchanged is bounded by the largest storage of all subtasks.
    limits = [by_name[f"storage_rate.{name}"].limit for name in ("cooperative", "relative")]
    peaks = [
        found.metrics["energy"][name]["storage_max_J"] for name in ("cooperative", "relative")
    ]
    assert limits[0] == limits[1] == pytest.approx(0.04 * max(peaks))
    moved = found.metrics["comparison"]["moved"]
    assert moved["natural"]["autonomy"]["cooperative"]["m"] > 1e-2
    assert moved["noninteracting"]["autonomy"]["cooperative"]["m"] < 1e-12
    assert moved["natural"]["human"]["relative"]["m"] > 1e-3
    assert moved["noninteracting"]["human"]["relative"]["m"] < 1e-12


def test_external_influences_are_named(tmp_path: Path) -> None:
    """Checks that a push invalidates do not apply; they do not count as passed."""

    def push(writer: RunWriter) -> None:
        data = serialize_message(to_wrench_stamped(0, np.zeros(6)))
        writer.add("/team/robot_1/push", WRENCH, 0, 0, data)

    run = record(tmp_path, scenario_values(), 0.3, extra=push)
    found = measure(Recorded(run), other_laws=False)
    for name in ("reproduction", "closed_form.relative", "noninteraction.human"):
        assert checks(found)[name].passed is None
        assert "robot_1/push" in checks(found)[name].reason


def test_inputs_of_one_subtask_leave_checks_of_the_other(tmp_path: Path) -> None:
    """An external input of one subtask does not affect the checks of the other."""

    def target(writer: RunWriter) -> None:
        data = serialize_message(to_wrench_stamped(0, np.zeros(6)))
        writer.add("/team/cooperative/human/wrench", WRENCH, 0, 0, data)

    run = record(tmp_path, scenario_values(), 1.2, extra=target)
    found = checks(measure(Recorded(run), other_laws=False))
    assert found["reproduction"].passed is None
    assert found["noninteraction.autonomy"].passed is None
    assert found["noninteraction.human"].passed
    assert found["closed_form.relative"].passed


def again(change: float) -> Callable[[RunWriter], None]:
    """Publish a reference of autonomy again, late, with its position changed."""
    codec = SubtaskCodec("relative", ("robot_1-robot_2",), ("x", "y"), False)
    position = np.array([1.0 + change, 1.0])

    def say(writer: RunWriter) -> None:
        data = reference(codec, 0.4, position)
        writer.add("/team/relative/autonomy/reference", MOTION, int(6e8), int(6e8), data)

    return say


def test_a_repeated_reference_is_no_conflict(tmp_path: Path) -> None:
    """A source repeats its reference when it receives a state twice: same bytes, same stamp."""
    run = record(tmp_path, scenario_values(), 1.2, extra=again(0.0))
    topic = "relative/autonomy/reference"
    assert len(run.log_times(topic)) == len(run.trajectory(topic).stamps) + 1
    found = measure(Recorded(run), other_laws=False)
    assert found.metrics["run"]["external_influences"] == []
    by_name = checks(found)
    for name in ("closed_form.relative", "reproduction", "noninteraction.autonomy"):
        assert by_name[name].passed


def test_conflicting_references_invalidate_checks(tmp_path: Path) -> None:
    """The reference in force is unknown: checks that depend on it do not apply."""
    run = record(tmp_path, scenario_values(), 1.2, extra=again(1e-9))
    found = checks(measure(Recorded(run), other_laws=False))
    for name in ("closed_form.relative", "reproduction", "noninteraction.human"):
        assert found[name].passed is None
        assert "conflicting references with equal stamps" in found[name].reason


def test_checks_of_single_ticks_do_not_apply_in_wall_time(tmp_path: Path) -> None:
    """Runs are not reproducible: nothing about single ticks passes or fails."""
    found = findings(tmp_path, lose, lockstep=False)
    by_name = checks(found)
    storage = [f"storage_{claim}.relative" for claim in ("growth", "passive", "rate")]
    for name in ("complete.ticks_missing", "closed_form.relative", "reproduction", *storage):
        assert by_name[name].passed is None
        assert "wall time" in by_name[name].reason
    assert by_name["noninteraction.human"].passed is None
    assert by_name["storage_positive.relative"].passed
    assert found.metrics["completeness"]["ticks_missing"] == 4


@pytest.mark.parametrize(
    ("message", "values", "text"),
    [
        ("running", {"law": "natural"}, "law changed to natural"),
        ("running", {"relative led by": "hold"}, "authority over relative changed to hold"),
        ("running", {"last start": "robot_1/x jumped by 0.3"}, "restarted: robot_1/x jumped"),
        ("stopped", {}, "the controller was stopped"),
        ("running", {"changed parameters": "relative.stiffness"}, "changed: relative.stiffness"),
    ],
)
def test_changes_at_run_time_are_named(
    tmp_path: Path, message: str, values: dict[str, object], text: str
) -> None:
    """Controller diagnostics show that a run left its scenario."""

    def add_status(writer: RunWriter) -> None:
        array = to_diagnostics(1, [to_status("/team/controller", Level.OK, message, values)])
        writer.add("/diagnostics", DIAGNOSTICS, 1, 1, serialize_message(array))

    run = record(tmp_path, scenario_values(), 0.1, extra=add_status)
    (found,) = measure(Recorded(run), other_laws=False).metrics["run"]["external_influences"]
    assert text in found


def test_diagnostics_are_summed_up(tmp_path: Path) -> None:
    """They contain worst and last level and rejected inputs; lost messages fail their check."""

    def add_status(writer: RunWriter) -> None:
        statuses = [
            (
                Level.WARN,
                "/team/robot_team",
                {"rejected inputs": 2, "last rejection": "push: NaN"},
            ),
            (Level.OK, "/team/robot_team", {"rejected inputs": 3}),
            (Level.WARN, "/team/recorder", {"lost": 4}),
        ]
        for level, name, values in statuses:
            message = to_diagnostics(1, [to_status(name, level, "text", values)])
            writer.add("/diagnostics", DIAGNOSTICS, 1, 1, serialize_message(message))

    run = record(tmp_path, scenario_values(), 0.1, extra=add_status)
    found = measure(Recorded(run), other_laws=False)
    assert found.metrics["diagnostics"]["/team/robot_team"] == {
        "worst_level": "WARN",
        "last_level": "OK",
        "last_message": "text",
        "refused_inputs": 3,
        "last_refusal": "push: NaN",
    }
    assert checks(found)["recorder_lost"].passed is False


def test_a_recording_that_cannot_be_analysed_gives_the_reason(tmp_path: Path) -> None:
    """A missing or invalid scenario is named in one line."""
    for text, reason in [
        (None, "no scenario"),
        ("/**: {ros__parameters: {robots: [a]}}", "invalid scenario: .*required"),
        ("rate: [", "invalid scenario"),
    ]:
        with RunWriter(tmp_path / "run.mcap", text, overwrite=True) as writer:
            data = serialize_message(to_wrench_stamped(0, np.zeros(6)))
            writer.add("/team/x", WRENCH, 0, 0, data)
        from noninteract_ros.reporting.recording.run import Run

        with pytest.raises(RecordingError, match=reason):
            Recorded(Run.open(tmp_path))


def test_rehearsals_last_until_a_source_has_taken_over() -> None:
    """The human's effect appears only after the planned hand-over."""
    scenario = load_scenario(find_scenario("hand_over"))
    assert source_starts(scenario) == {"human": 2.5, "autonomy": 0.0}
