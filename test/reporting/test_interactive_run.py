# SPDX-License-Identifier: Apache-2.0
"""Reports of interactive runs: each check covers the intervals in which it applies."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rclpy.serialization import serialize_message
from rehearsed import DIAGNOSTICS, Act, Tamper, record, scenario_values

from noninteract_ros.control.references.inputs import Rate
from noninteract_ros.control.references.subtask_input import AUTHORITIES
from noninteract_ros.nodes.messages.messages import Level, to_diagnostics, to_status
from noninteract_ros.reporting.checks.checks import Check
from noninteract_ros.reporting.figures.account_figure import account_figure
from noninteract_ros.reporting.figures.figures import storage_figure, tracking_figure
from noninteract_ros.reporting.figures.marks import transitions
from noninteract_ros.reporting.metrics import intervals
from noninteract_ros.reporting.metrics.closed_form import closed_form
from noninteract_ros.reporting.metrics.influences import influences
from noninteract_ros.reporting.metrics.passivity_observer import observe
from noninteract_ros.reporting.metrics.storage_functions import storage_balance
from noninteract_ros.reporting.recording.recorded import Recorded
from noninteract_ros.reporting.recording.writer import RunWriter
from noninteract_ros.reporting.report.metrics import measure
from noninteract_ros.scenario.files import find_scenario, for_console, read_parameters
from noninteract_ros.scenario.rehearsal import Rehearsal

STORAGE = ("storage_growth", "storage_passive", "storage_rate")


def lead(subtask: str, *velocity: float) -> Act:
    """Send a target velocity, like pads, keys and target_twist."""

    def act(rehearsal: Rehearsal) -> None:
        now = rehearsal.simulation.now
        source = rehearsal.controller.inputs[subtask].sources["human"]
        source.receive(now, Rate(np.array(velocity)), now)

    return act


def law(name: str) -> Act:
    return lambda rehearsal: rehearsal.controller.set_law(name)


def stiffer(rehearsal: Rehearsal) -> None:
    """Set four times the stiffness of the cooperative subtask."""
    settings = rehearsal.controller._settings[0]
    stiffness = tuple(4.0 * k for k in settings.stiffness)
    rehearsal.controller.set_impedance("cooperative", replace(settings, stiffness=stiffness))


def give(subtask: str, source: str) -> Act:
    return lambda rehearsal: rehearsal.controller.set_authority(subtask, source)


def stop(rehearsal: Rehearsal) -> None:
    rehearsal.controller.stop()


def resume(rehearsal: Rehearsal) -> None:
    rehearsal.controller.resume()


def reset(rehearsal: Rehearsal) -> None:
    rehearsal.simulation.reset()


SESSION: dict[float, Act] = {
    0.1: lead("cooperative", 0.3, 0.1),
    0.5: give("relative", "human"),
    0.51: lead("relative", 0.2, 0.0),
    0.8: stop,
    1.0: resume,
    1.05: lead("cooperative", -0.3, 0.1),
    1.2: law("natural"),
    1.4: lead("cooperative", 0.2, -0.3),
    1.5: law("energy_gated"),
    1.8: stiffer,
    2.0: lead("cooperative", -0.2, 0.2),
    2.35: reset,
    2.5: lead("cooperative", 0.2, 0.1),
}


def values_of(scenario: str, **changes: Any) -> dict[str, Any]:
    """Return a scenario as run by `demo --console`, without planner."""
    values = for_console(read_parameters(find_scenario(scenario)), 0)
    return {name: item for name, item in values.items() if name != "planner"} | changes


def measured(
    folder: Path,
    values: Mapping[str, Any],
    acts: Mapping[float, Act],
    tamper: Tamper | None = None,
) -> tuple[Recorded, dict[str, Check]]:
    values_reported = {
        "changed parameters": "cooperative.stiffness" if stiffer in acts.values() else "none"
    }

    def add_status(writer: RunWriter) -> None:
        message = to_diagnostics(
            1, [to_status("/team/controller", Level.OK, "running", values_reported)]
        )
        writer.add("/diagnostics", DIAGNOSTICS, 2, 2, serialize_message(message))

    recorded = Recorded(record(folder, values, 3.0, tamper, add_status, acts))
    found = measure(recorded, other_laws=False)
    return recorded, {check.name: check for check in found.checks}


@pytest.fixture(scope="module", params=["paper", "planar_arms"])
def session(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Recorded, dict[str, Check]]:
    return measured(tmp_path_factory.mktemp(request.param), values_of(request.param), SESSION)


def test_an_interactive_run_fails_no_check(
    session: tuple[Recorded, dict[str, Check]],
) -> None:
    """With hand-overs, a stop, other laws and gains, and a reset, the storage checks pass."""
    _, checks = session
    assert [check for check in checks.values() if check.passed is False] == []
    for claim in ("storage_passive", "storage_rate"):
        assert checks[f"{claim}.cooperative"].passed
        assert checks[f"{claim}.relative"].passed
    assert "law changed to natural" in checks["reproduction"].reason


def test_only_transitions_stops_and_resets_are_excluded(
    session: tuple[Recorded, dict[str, Check]],
) -> None:
    """All other intervals are checked."""
    recorded, _ = session
    found = storage_balance(recorded, "cooperative")
    middle = 0.5 * (found.t[1:] + found.t[:-1])
    fade = recorded.scenario.general.transition_time
    out = [(0.8, 1.0 + fade), (1.2, 1.2 + fade), (1.5, 1.5 + fade), (1.8, 1.8 + fade)]
    near = 3.0 / recorded.scenario.general.telemetry_rate
    for first, last in out:
        inside = (middle > first + near) & (middle < last - near)
        assert inside.any()
        assert not found.in_force[inside].any()
    clear = np.ones(len(middle), dtype=bool)
    for first, last in [*out, (2.35, 2.35)]:
        clear &= (middle < first - near) | (middle > last + near)
    gates = without_interventions(recorded, middle)
    assert found.in_force[clear & gates].all()
    assert (found.law[(found.t > 1.21) & (found.t < 1.49)] == "natural").all()


def without_interventions(recorded: Recorded, t: np.ndarray) -> np.ndarray:
    """Return True at times without interventions within 20 ms."""
    entry = recorded.energy_entry("cooperative", "interventions")
    assert entry is not None
    counts = np.interp(t - 0.02, *entry), np.interp(t + 0.02, *entry)
    return np.asarray(counts[0] == counts[1])


def test_each_subtask_follows_its_closed_form_between_transitions(tmp_path: Path) -> None:
    """(29) is checked against the desired motion; changed gains are not recorded."""
    acts = {time: act for time, act in SESSION.items() if act is not stiffer}
    recorded, checks = measured(tmp_path / "sound", values_of("paper"), acts)
    for name in ("closed_form.cooperative", "closed_form.relative"):
        assert checks[name].passed
    found = closed_form(recorded, "cooperative", influences(recorded))
    assert found.t.size < 0.95 * len(recorded.t)
    assert not ((found.t > 1.25) & (found.t < 1.45)).any()  # Under `natural`.

    def drift(topic: str, time: float, arrays: list[np.ndarray]) -> list[np.ndarray]:
        if topic == "joint_states" and time > 2.6:
            arrays[0] = arrays[0] + [0.05 * (time - 2.6), 0.0, 0.0, 0.0]
        return arrays

    _, broken = measured(tmp_path / "broken", values_of("paper"), acts, drift)
    assert broken["closed_form.relative"].passed is False


def test_a_reset_is_no_motion(session: tuple[Recorded, dict[str, Check]]) -> None:
    """The passivity observer does not count it as external work."""
    recorded, _ = session
    resets = recorded.t[1:][~intervals.continuous_steps(recorded)]
    np.testing.assert_allclose(resets, [2.35])
    assert observe(recorded).gaps == 1


def test_authority_is_recorded(session: tuple[Recorded, dict[str, Check]]) -> None:
    """It is `hold` before the first input and after its timeout."""
    recorded, _ = session
    entry = recorded.energy_entry("cooperative", "leader")
    assert entry is not None
    leader = dict(zip(np.round(entry[0], 3).tolist(), entry[1].astype(int).tolist(), strict=True))
    assert AUTHORITIES[leader[0.04]] == "hold"
    assert AUTHORITIES[leader[0.4]] == "human"
    assert AUTHORITIES[leader[0.72]] == "hold"
    assert recorded.start("cooperative") == pytest.approx(0.1, abs=0.005)


def test_figures_mark_transitions(
    session: tuple[Recorded, dict[str, Check]],
) -> None:
    """The stop, each transition and the restart are shaded."""
    recorded, _ = session
    spans = transitions(recorded)
    starts = [0.8, 1.5, 1.8]  # The transition at 1.2 s follows that of the resume.
    assert all(any(abs(first - start) < 0.02 for first, _ in spans) for start in starts)
    for figure in (tracking_figure(recorded, "relative"), storage_figure(recorded)):
        assert [len(axes.patches) for axes in figure.axes] == [len(spans)] * 2
        (legend,) = figure.legends
        assert legend.get_texts()[-1].get_text() == "stop or transition"
    assert storage_figure(recorded).axes[1].get_xlabel() == "time [s]"
    assert [len(axes.patches) for axes in account_figure(recorded).axes] == [len(spans)] * 4


def test_figures_name_the_leading_source(tmp_path: Path) -> None:
    """Names are above the curves at hand-overs; runs with one source have none."""
    values = values_of("paper") | {"planner": read_parameters(find_scenario("paper"))["planner"]}
    acts = {
        0.4: give("relative", "human"),
        **{0.31 + 0.1 * k: lead("relative", 0.1, 0.0) for k in range(1, 10)},
    }
    recorded = Recorded(record(tmp_path, values, 1.2, acts=acts))
    figure = tracking_figure(recorded, "relative")
    assert {text.get_text() for text in figure.axes[0].texts} == {"autonomy", "human"}
    assert not list(tracking_figure(recorded, "cooperative").axes[0].texts)


def test_unsupplied_energy_fails_after_interventions(tmp_path: Path) -> None:
    """Storage that grows without supply at the end fails both checks."""

    def pumped(topic: str, time: float, arrays: list[np.ndarray]) -> list[np.ndarray]:
        if topic == "relative/energy" and time > 2.6:
            arrays[0][1] += 0.5 * (time - 2.6)
        return arrays

    _, checks = measured(tmp_path, values_of("paper"), SESSION, pumped)
    assert checks["storage_passive.relative"].passed is False
    assert checks["storage_rate.relative"].passed is False


def test_bounds_do_not_grow_with_a_reset(tmp_path: Path) -> None:
    """The torque step at a reset does not loosen the limits."""
    moves = {0.1: lead("cooperative", 0.3, 0.1)}
    limits = [
        measured(tmp_path / str(len(acts)), values_of("planar_arms"), acts)[1]
        for acts in (moves, moves | {0.4: reset})
    ]
    for claim in STORAGE:
        name = f"{claim}.cooperative"
        assert limits[1][name].limit < 3.0 * limits[0][name].limit


def test_only_the_balance_applies_to_a_coupling_law(tmp_path: Path) -> None:
    """The other checks give the law as reason; it has no gates."""
    values = scenario_values(law="energy_gated", object=None)
    _, checks = measured(tmp_path, values, {0.0: law("natural")})
    for name in ("storage_growth.relative", "storage_passive.relative"):
        assert checks[name].passed is None
        assert "natural" in checks[name].reason
    assert checks["storage_rate.relative"].passed
    assert checks["account.sigma"].passed is None
