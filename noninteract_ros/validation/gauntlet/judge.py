# SPDX-License-Identifier: Apache-2.0
"""Stability verdict on a case under a law, by simulation and by eigenvalues of linear loops."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.control.energy.tank import levels
from noninteract_ros.validation.gauntlet import state
from noninteract_ros.validation.gauntlet.accounting import sigma_of
from noninteract_ros.validation.gauntlet.cases import Case
from noninteract_ros.validation.gauntlet.law import new_terms
from noninteract_ros.validation.gauntlet.loop import growth_rate, plant_of
from noninteract_ros.validation.gauntlet.plant import PlantArrays
from noninteract_ros.validation.gauntlet.settings import LAWS, GauntletSettings
from noninteract_ros.validation.gauntlet.simulation import run

STATES = ("at rest", "unbounded", "not at rest", "out of reach")  # by the compiled verdict
LEAST = 4.0  # [s] shortest duration of a case
WINDOW = 0.5  # [s]
QUIET = 1e-3  # speed at rest relative to its peak
VERY_QUIET = 1e-9  # the same for loops with unstable eigenvalues
GROWTH = 100.0  # unbounded energy relative to the initial one
NEUTRAL = 1e-3  # [1/s] growth rate of a continuum of equilibria, or of a closed impedance gate
YIELDED = 0.5  # nu below which the impedance counts as yielded


@dataclass(frozen=True)
class Verdict:
    """Outcome of a case under a law; energies are relative to the initial energy.

    Attributes:
        index: Number of the case.
        law: The law.
        state: One of `STATES`.
        time: Duration of the simulation [s].
        speed: Largest speed of the last window relative to the peak.
        slowing: Largest speed of the last window relative to the window before.
        growth: Growth rate of the linear loop [1/s], with the final gates for the gated law;
            None for nonlinear cases.
        agreed: True if simulation and eigenvalue agree; None if either is undecided.
        sigma_mean: Mean of sigma.
        sigma_least: Smallest sigma.
        sigma_full: Share of time with sigma = 1.
        sigma: Last sigma.
        nu: Last nu.
        nu_least: Smallest nu.
        level_least: Smallest level of the tank [J].
        residual: Largest r = W - W(0) - supplied energy, less the imbalance.
        mismatch: Largest |r + L|, less the imbalance.
        imbalance: Energy error of the integration of the plant.
        sampling: Largest error of an account with power times time instead of measured work.
        cause: Cause of motion at the end, or an empty text.
    """

    index: int
    law: str
    state: str
    time: float
    speed: float
    slowing: float
    growth: float | None
    agreed: bool | None
    sigma_mean: float
    sigma_least: float
    sigma_full: float
    sigma: float
    nu: float
    nu_least: float
    level_least: float
    residual: float
    mismatch: float
    imbalance: float
    sampling: float
    cause: str = ""

    @property
    def settled(self) -> bool:
        """True if the case came to rest."""
        return self.state == STATES[state.SETTLED]

    @property
    def yields(self) -> bool:
        """True if the impedance gate is nearly closed."""
        return self.nu < YIELDED

    @property
    def unstable(self) -> bool:
        """True if eigenvalue or simulation shows unbounded growth."""
        if self.law != "energy_gated" and self.growth is not None and self.growth > NEUTRAL:
            return True
        return self.state == STATES[state.UNBOUNDED]


def judge(case: Case, settings: GauntletSettings) -> list[Verdict]:
    """Return a verdict for each law."""
    plant = plant_of(case, settings.period)
    verdicts = [_verdict(case, plant, law, settings) for law in settings.laws]
    unsettled = [item.law for item in verdicts if not item.settled]
    if not unsettled:
        return verdicts
    natural = next((item for item in verdicts if item.law == "natural"), None)
    natural = natural or _verdict(case, plant, "natural", settings)
    return [
        item if item.settled else replace(item, cause=_cause(item, natural)) for item in verdicts
    ]


def trace(case: Case, law: str, settings: GauntletSettings, rows: int, stride: int) -> Array:
    """Return a run of a case, every `stride` ticks; columns of `simulation.record`."""
    table = np.full((rows, state.TRACED + 2 * case.start.shape[1] + case.team.n), np.nan)
    seconds = rows * stride * settings.period
    limits = _limits(settings, seconds, least=seconds)
    _run(case, plant_of(case, settings.period), law, settings, limits, (table, stride))
    return table[~np.isnan(table[:, 0])]


def _verdict(case: Case, plant: PlantArrays, law: str, settings: GauntletSettings) -> Verdict:
    linear = case.linear and settings.drop == 0.0
    found = _judged(case, plant, law, settings, _limits(settings, settings.horizon), linear)
    if linear and found.settled and found.growth is not None and found.growth > NEUTRAL:
        # Slow growth may not be visible yet: continue to a lower speed.
        patient = _limits(settings, settings.horizon, quiet=VERY_QUIET)
        return _judged(case, plant, law, settings, patient, linear)
    return found


def _limits(
    settings: GauntletSettings, seconds: float, quiet: float = QUIET, least: float = LEAST
) -> state.Limits:
    least, most, window = (max(1, round(t * settings.rate)) for t in (least, seconds, WINDOW))
    return state.Limits(int(least), most, window, quiet, GROWTH)


def _run(
    case: Case,
    plant: PlantArrays,
    law: str,
    settings: GauntletSettings,
    limits: state.Limits,
    traced: tuple[Array, int] | None = None,
) -> tuple[int, int, Any, state.Memory, state.Meter]:
    n = case.team.n
    memory = state.new_memory(case.start, n, settings.delay)
    meter = state.new_meter()
    none = np.zeros((0, state.TRACED + 2 * case.start.shape[1] + n))
    tank = levels(settings.tank, settings.tank.reference_credit)
    withheld = levels(settings.tank, settings.tank.reference_credit, refills=False)
    link = state.DelayedLink(settings.period, settings.delay, settings.drop, case.index)
    ended, ticks, account = run(
        case.team,
        case.around,
        plant,
        new_terms(case.team),
        LAWS.index(law),
        tank,
        withheld,
        link,
        limits,
        memory,
        meter,
        *(traced or (none, 1)),
    )
    return ended, ticks, account, memory, meter


def _judged(
    case: Case,
    plant: PlantArrays,
    law: str,
    settings: GauntletSettings,
    limits: state.Limits,
    linear: bool,
) -> Verdict:
    ended, ticks, account, memory, meter = _run(case, plant, law, settings, limits)
    growth = None
    if linear:
        gates = sigma_of(LAWS.index(law), account), account.nu, account.damping
        growth = growth_rate(case, settings.period, settings.delay, *gates)
    scale = float(memory.began.sum())
    imbalance = float(meter.imbalance[0])
    time = ticks * settings.period
    return Verdict(
        index=case.index,
        law=law,
        state=STATES[ended],
        time=time,
        speed=float(meter.last[0] / meter.peak[0]),
        slowing=float(meter.last[0] / max(meter.before[0], 1e-300)),
        growth=growth,
        agreed=_agreed(ended, growth, law, time),
        sigma_mean=float(meter.sums[0] / meter.sums[2]),
        sigma_least=float(meter.least[0]),
        sigma_full=float(meter.sums[1] / meter.sums[2]),
        sigma=sigma_of(LAWS.index(law), account),
        nu=account.nu,
        nu_least=float(meter.least[1]),
        level_least=float(meter.least[2]),
        residual=(float(meter.residual[0]) - imbalance) / scale,
        mismatch=(float(meter.mismatch[0]) - imbalance) / scale,
        imbalance=imbalance / scale,
        sampling=float(meter.sampling[0]) / scale,
    )


def _agreed(ended: int, growth: float | None, law: str, time: float) -> bool | None:
    """Return True if eigenvalue and simulation agree; None if either is undecided.

    The simulation does not decide loops too slow to settle or to diverge within its duration. The
    eigenvalue of a gated loop uses the final gates and decides only whether it comes to rest.
    """
    if growth is None or ended == state.ESCAPED:
        return None
    if ended == state.SETTLED:
        return growth <= NEUTRAL
    if ended == state.UNBOUNDED:
        return None if law == "energy_gated" else growth > 0.0
    undecided = law == "energy_gated" or abs(growth) * time < -2.0 * np.log(QUIET)
    return None if undecided else False


def _cause(found: Verdict, natural: Verdict) -> str:
    """Return the most likely cause why a case is not at rest."""
    if found.unstable and found.law not in ("natural", "energy_gated"):
        return "the law"
    if natural.unstable or natural.state == STATES[state.UNBOUNDED]:
        return "the natural law is unstable"
    if found.yields:
        return "impedance gate closed"
    if found.slowing < 1.0 or (found.growth is not None and found.growth < -1e-6):
        return "still decaying"
    return "sustained"
