# SPDX-License-Identifier: Apache-2.0
"""The energy account on its own and closed over two point masses on a door."""

from dataclasses import astuple, replace

import numpy as np
import pytest
from scipy.linalg import expm

from noninteract_ros.control.energy.tank import (
    Interval,
    TankSettings,
    affordable,
    full_tank,
    observed,
    refill,
    revalue,
)
from noninteract_ros.control.energy.tank import step as advance
from noninteract_ros.errors import ScenarioError

SETTINGS = TankSettings()
STILL = Interval(1e-3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def tank_with(level, **values):
    """A tank with the reserve full and this level [J]."""
    return replace(full_tank(SETTINGS, 0.0), level=level, **values)


def random_intervals(count, seed=3):
    """Intervals with works of both signs; a potential goes on where the last one ended."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        work = rng.normal(0.0, 0.05, 2)
        arrived, potential = rng.uniform(0.0, 1.0, 2).tolist()
        jump, led, demand = rng.normal(0.0, (0.01, 0.01, 20.0)).tolist()
        yield Interval(1e-3, *work.tolist(), led, arrived, potential, jump, 1.0, demand)


def held(tank):
    """Energy that the controller holds: spring, reserve and tank [J]."""
    return tank.grip * tank.potential + tank.reserve + tank.level


def test_the_account_balances_to_rounding():
    """What is held changes by the work taken in, the references' share, credit and loss alone."""
    tank = full_tank(SETTINGS, 0.0)
    for interval in random_intervals(2000):
        after = advance(tank, interval, SETTINGS)
        moved = tank.grip * (interval.potential - interval.arrived)
        taken = -interval.impedance_work - interval.decoupling_work
        expected = taken + moved + (after.granted - tank.granted) - (after.lost - tank.lost)
        assert held(after) - held(tank) == pytest.approx(expected, abs=1e-12)
        assert after.lost >= tank.lost
        tank = after


def test_the_gates_stay_in_range_and_sigma_within_its_rates():
    """Whatever is booked, no gate leaves 0 to 1 and sigma never steps."""
    tank = full_tank(SETTINGS, 0.0)
    for interval in random_intervals(2000, seed=4):
        after = advance(tank, interval, SETTINGS)
        assert 0.0 <= after.sigma <= 1.0
        assert 0.0 <= after.grip <= 1.0
        change = (after.sigma - tank.sigma) / interval.step
        assert -SETTINGS.closing_rate - 1e-9 <= change <= SETTINGS.opening_rate + 1e-9
        tank = after


def test_standing_still_keeps_complete_decoupling():
    """Without motion nothing is paid and sigma stays exactly 1."""
    tank = full_tank(SETTINGS, 0.0)
    for _ in range(1000):
        tank = advance(tank, STILL, SETTINGS)
    assert tank == full_tank(SETTINGS, 0.0)


def test_an_empty_tank_does_not_fill_by_itself():
    """Time alone refills nothing."""
    empty = tank_with(0.0, sigma=0.0)
    tank = empty
    for _ in range(10_000):
        tank = advance(tank, STILL, SETTINGS)
    assert tank == empty


def test_a_fraction_of_the_damping_refills_the_tank_up_to_its_capacity():
    """What the impedance absorbs refills the tank by its share and no further than full."""
    tank = tank_with(0.0, sigma=0.0)
    damped = replace(STILL, impedance_work=-0.1)
    tank = advance(tank, damped, SETTINGS)
    assert tank.level == pytest.approx(0.1 * SETTINGS.refill_fraction)
    for _ in range(1000):
        tank = advance(tank, damped, SETTINGS)
    assert tank.level == SETTINGS.capacity


def test_sampling_errors_are_paid_from_the_reserve_and_restored_first():
    """Energy that the impedance itself injects costs reserve, then grip, never decoupling."""
    quarter = 0.25 * SETTINGS.reserve
    injects, absorbs = (replace(STILL, impedance_work=work) for work in (quarter, -quarter))
    tank, grips = full_tank(SETTINGS, 0.0), []
    for interval in (injects, injects, injects, absorbs, absorbs):
        tank = advance(tank, interval, SETTINGS)
        assert tank.level == SETTINGS.initial
        grips.append(tank.grip)
    np.testing.assert_allclose(grips, [1.0, 1.0, 0.5, 1.0, 1.0])


def test_references_that_come_and_go_are_credited_once():
    """Bringing energy, taking it back and bringing it again grants the credit of one."""
    tank = full_tank(SETTINGS, 0.0)
    for potential in (0.3, 0.0, 0.3, 0.0, 0.3):
        jump = replace(STILL, arrived=tank.potential, potential=potential, storage=potential)
        tank = advance(tank, jump, SETTINGS)
    assert tank.granted == pytest.approx(0.3 * SETTINGS.reference_credit)


def test_an_operator_refill_opens_the_gate_at_its_own_rate():
    """`refill` fills tank and reserve and says what it granted; sigma rises, it does not step."""
    tank = refill(tank_with(-0.1, reserve=0.0, sigma=0.0, grip=0.0), SETTINGS)
    assert (tank.level, tank.reserve) == (SETTINGS.capacity, SETTINGS.reserve)
    assert tank.refilled == pytest.approx(SETTINGS.capacity + 0.1 + SETTINGS.reserve)
    tank = advance(tank, STILL, SETTINGS)
    assert tank.sigma == pytest.approx(SETTINGS.opening_rate * STILL.step)


def test_a_change_waits_until_the_tank_can_pay():
    """What is beyond the open tank is taken in shares; what returns energy is free."""
    tank = full_tank(SETTINGS, 0.0)
    spare = tank.level - SETTINGS.full_gate
    assert affordable(tank, 4.0 * spare, SETTINGS) == pytest.approx(0.25)
    assert affordable(tank, -1.0, SETTINGS) == 1.0
    assert affordable(tank_with(0.1), 1.0, SETTINGS) == 0.0


def test_a_spring_is_revalued_without_loss():
    """A stiffer spring is paid from the tank, a softer one gives back to the reserve."""
    tank = full_tank(SETTINGS, 0.5)
    stiffer = revalue(tank, 0.8)
    assert stiffer.level == pytest.approx(tank.level - 0.3)
    softer = revalue(stiffer, 0.1)
    assert softer.reserve == pytest.approx(tank.reserve + 0.7)
    for item in (stiffer, softer):
        assert held(item) == pytest.approx(held(tank), abs=1e-15)


def test_an_observed_account_has_no_gates():
    """For a law without gates the spring is whole and the balance is the same."""
    tank = replace(full_tank(SETTINGS, 0.5), grip=0.3, sigma=0.4)
    seen = observed(tank, 0.0)
    assert (seen.grip, seen.sigma) == (1.0, 0.0)
    assert held(seen) == pytest.approx(held(tank), abs=1e-15)


def test_many_accounts_at_once_are_each_alone():
    """With arrays for numbers each element is booked as it would be alone, to the last bit."""
    runs = [list(random_intervals(200, seed)) for seed in (5, 6, 7)]
    alone = [full_tank(SETTINGS, 0.0) for _ in runs]
    together = full_tank(SETTINGS, np.zeros(len(runs)))
    for intervals in zip(*runs, strict=True):
        alone = [advance(t, i, SETTINGS) for t, i in zip(alone, intervals, strict=True)]
        rows = zip(*(astuple(interval) for interval in intervals), strict=True)
        together = advance(together, Interval(*map(np.array, rows)), SETTINGS)
        for name in ("level", "reserve", "sigma", "grip", "owed", "lost", "granted", "brought"):
            expected = [getattr(tank, name) for tank in alone]
            np.testing.assert_array_equal(getattr(together, name), expected)


@pytest.mark.parametrize(
    "values", [{"initial": 3.0}, {"reopening_level": 0.25}, {"reopening_level": 2.5}]
)
def test_levels_that_do_not_fit_together_are_refused(values):
    """Levels that cannot be reached, or that would let sigma breathe, are named."""
    with pytest.raises(ScenarioError, match=next(iter(values))):
        TankSettings(**values).check()


def closed_by_half():
    """A tank whose level let sigma fall to one half."""
    tank = tank_with(0.5 * SETTINGS.full_gate)
    for _ in range(20):
        tank = advance(tank, STILL, SETTINGS)
    assert tank.sigma == 0.5
    return tank


def test_a_gate_that_has_closed_stays_until_the_tank_has_regained_its_level():
    """Sigma falls with the tank and rises again only from the reopening level on."""
    tank = closed_by_half()
    short = SETTINGS.reopening_level - tank.level
    for share, open_again in ((0.9, False), (0.2, True)):
        damped = -share * short / SETTINGS.refill_fraction
        tank = advance(tank, replace(STILL, impedance_work=damped), SETTINGS)
        assert (tank.sigma > 0.5) == open_again
        assert (tank.level >= SETTINGS.reopening_level) == open_again


def test_what_the_decoupling_returns_does_not_reopen_its_gate():
    """A loan that comes back fills the tank to the brim, and sigma stays until more comes in."""
    tank = advance(closed_by_half(), replace(STILL, decoupling_work=-10.0), SETTINGS)
    assert tank.level == SETTINGS.capacity
    assert tank.sigma == 0.5
    quantum = SETTINGS.reopening_level - SETTINGS.full_gate
    damped = replace(STILL, impedance_work=-1.01 * quantum / SETTINGS.refill_fraction)
    led = replace(STILL, input_work=1.01 * quantum, storage=10.0)
    assert advance(tank, damped, SETTINGS).sigma > 0.5
    assert advance(tank, led, SETTINGS).sigma > 0.5
    assert advance(refill(tank, SETTINGS), STILL, SETTINGS).sigma > 0.5


def test_a_demand_beyond_a_full_tank_owes_nothing():
    """What only the power wanted for a moment has closed opens when it is over."""
    tank = advance(tank_with(SETTINGS.capacity), replace(STILL, demand=1000.0), SETTINGS)
    assert tank.sigma < 1.0
    assert advance(tank, STILL, SETTINGS).sigma > tank.sigma


def test_reopenings_are_bounded_by_what_came_in():
    """Whatever lends and returns, each reopening after a shortage has cost a whole quantum."""
    tank, came_in, reopenings, falling = tank_with(1.0), 0.0, 0, True
    rng = np.random.default_rng(11)
    for _ in range(30_000):
        lent = float(rng.normal(0.1 * (tank.level - 0.6), 0.2))
        damped = float(rng.uniform(0.0, 0.02))
        booked = replace(STILL, decoupling_work=lent, impedance_work=-damped)
        after = advance(tank, booked, SETTINGS)
        came_in += SETTINGS.refill_fraction * damped
        if after.owed > tank.owed:
            falling = True
        elif after.sigma > tank.sigma and falling:
            reopenings, falling = reopenings + 1, False
        tank = after
    quantum = SETTINGS.reopening_level - SETTINGS.full_gate
    assert 50 < reopenings <= came_in / quantum


class Door:
    """Two masses with a lever spring; the exact zero-order hold of theory.md's example."""

    period = 1e-3

    def __init__(self):
        angle = np.deg2rad(114.26)
        b = np.array([np.cos(angle), np.sin(angle)])
        self.masses, self.door = np.array([1.0, 4.0]), 5e4 * np.outer(b, b)
        self.J = np.array([[0.5, 0.5], [1.0, -1.0]])
        S = np.linalg.inv(self.J)
        self.inertia = S.T @ np.diag(self.masses) @ S
        own = np.diag(self.inertia)
        self.K = np.array([10.0, 1825.0])
        self.D = 2.0 * np.array([0.84, 1.59]) * np.sqrt(self.K * own)
        self.coupling = self.inertia / own - np.eye(2)  # Lambda M_s^-1 - I
        self.A, self.B = self._hold()

    def _hold(self):
        rate = np.zeros((6, 6))
        rate[:2, 2:4] = np.eye(2)
        rate[2:4, :2] = -self.door / self.masses[:, None]
        rate[2:4, 4:] = np.diag(1.0 / self.masses)
        held_rate = expm(rate * self.period)
        return held_rate[:4, :4], held_rate[:4, 4:]

    def environment(self, q):
        return 0.5 * q @ self.door @ q

    def run(self, seconds, gated=True):
        """Rows of V (with T), tank, sigma, residual relative to the environment."""
        state, tank, rows = np.array([0.01, 0.01, 0.0, 0.0]), None, []
        impedance = decoupling = np.zeros(2)
        start, e_last = 0.0, self.J @ state[:2]
        for _ in range(round(seconds / self.period)):
            e, e_rate = self.J @ state[:2], self.J @ state[2:]
            potential = 0.5 * e @ (self.K * e)
            kinetic = 0.5 * e_rate @ self.inertia @ e_rate
            pull = -(self.D * e_rate + self.K * e)
            if tank is None:
                tank = full_tank(SETTINGS, potential)
                start = held(tank) + kinetic + self.environment(state[:2])
            else:
                moved = e - e_last
                demand = e_rate @ self.coupling @ pull
                works = impedance @ moved, decoupling @ moved
                interval = Interval(
                    self.period,
                    *works,
                    0.0,
                    potential,
                    potential,
                    0.0,
                    kinetic + potential,
                    demand,
                )
                tank = advance(tank, interval, SETTINGS)
            sigma, grip = (tank.sigma, tank.grip) if gated else (1.0, 1.0)
            impedance = grip * pull
            decoupling = sigma * (self.coupling @ impedance)
            residual = held(tank) + kinetic + self.environment(state[:2]) - start
            rows.append((potential + kinetic, tank.level, sigma, residual, tank.lost))
            e_last = e
            state = self.A @ state + self.B @ (self.J.T @ (impedance + decoupling))
        return np.array(rows)


def test_the_door_grows_without_a_gate_at_the_stated_rate():
    """Complete decoupling on the door grows at the eigenvalue of theory.md, 17.7 /s."""
    V = Door().run(1.0, gated=False)[:, 0]
    rate = 0.5 * np.log(V[-1] / V[-201]) / 0.2
    assert rate == pytest.approx(17.68, abs=0.01)


def test_the_gated_door_settles():
    """With the tank it comes to rest, sigma comes to rest, and the tank is never overdrawn."""
    V, level, sigma, _, _ = Door().run(5.0).T
    assert V.max() < SETTINGS.initial + SETTINGS.reserve
    assert V[-1] < 1e-9
    assert np.ptp(sigma[-1000:]) < 1e-3
    assert level.min() >= 0.0


def test_the_residual_of_the_door_is_what_was_lost_to_rounding():
    """Storage plus the door's energy falls by exactly the loss of the account."""
    _, _, _, residual, lost = Door().run(2.0).T
    np.testing.assert_allclose(residual, -lost, atol=1e-12)
    assert residual.max() <= 1e-12
