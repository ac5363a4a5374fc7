# SPDX-License-Identifier: Apache-2.0
"""The energy account on its own and closed over two point masses on a door."""

import numpy as np
import pytest
from scipy.linalg import expm

from noninteract_ros.control.energy.tank import (
    Interval,
    TankSettings,
    affordable,
    carry,
    deepen,
    full_tank,
    levels,
    loosen,
    refill,
    revalue,
    whole,
)
from noninteract_ros.control.energy.tank import step as advance
from noninteract_ros.errors import ScenarioError

SETTINGS = TankSettings()
LEVELS = levels(SETTINGS, SETTINGS.reference_credit)
STILL = Interval(1e-3, *[0.0] * 9)


def tank_with(level, **values):
    """A tank with the reserve full and this level [J]."""
    return full_tank(LEVELS, 0.0)._replace(level=level, **values)


def random_intervals(count, seed=3):
    """Intervals with works of both signs."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        paid, other, damped, led = rng.normal(0.0, (0.05, 0.05, 0.05, 0.01)).tolist()
        arrived, potential, margins = rng.uniform(0.0, 1.0, 3).tolist()
        demand = float(rng.normal(0.0, 20.0))
        yield Interval(
            1e-3, paid, other, damped, arrived, potential, 0.1 * margins, led, 1.0, demand
        )


def held(tank):
    """Energy that the controller holds: springs, margins, reserve and tank [J]."""
    return tank.nu * tank.potential + tank.margins + tank.reserve + tank.level


def test_the_account_balances_to_rounding():
    """The stored energy changes by absorbed work, the references' share, credit and loss alone."""
    tank = full_tank(LEVELS, 0.0)
    for interval in random_intervals(2000):
        after = advance(tank, interval, LEVELS)
        moved = tank.nu * (interval.potential - interval.arrived)
        taken = -interval.other_work - interval.decoupling_work
        expected = taken + moved + (after.granted - tank.granted) - (after.lost - tank.lost)
        assert held(after) - held(tank) == pytest.approx(expected, abs=1e-12)
        assert after.lost >= tank.lost
        tank = after


def test_the_gates_stay_in_range_and_sigma_within_its_rates():
    """For any booking, no gate leaves 0 to 1 and sigma never steps."""
    tank = full_tank(LEVELS, 0.0)
    for interval in random_intervals(2000, seed=4):
        after = advance(tank, interval, LEVELS)
        assert 0.0 <= after.sigma <= 1.0
        assert 0.0 <= after.nu <= 1.0
        change = (after.sigma - tank.sigma) / interval.step
        assert -SETTINGS.closing_rate - 1e-9 <= change <= SETTINGS.opening_rate + 1e-9
        tank = after


def test_standing_still_keeps_complete_decoupling():
    """Without motion nothing is paid and sigma stays exactly 1."""
    tank = full_tank(LEVELS, 0.0)
    for _ in range(1000):
        tank = advance(tank, STILL, LEVELS)
    assert tank == full_tank(LEVELS, 0.0)


def test_an_empty_tank_does_not_fill_by_itself():
    """Time alone refills nothing."""
    empty = tank_with(0.0, sigma=0.0)
    tank = empty
    for _ in range(10_000):
        tank = advance(tank, STILL, LEVELS)
    assert tank == empty


def test_a_fraction_of_the_damping_refills_the_tank_up_to_its_capacity():
    """Energy that the impedance absorbs refills the tank by its share and no further than full."""
    tank = tank_with(0.0, sigma=0.0)
    damped = STILL._replace(other_work=-0.1)
    tank = advance(tank, damped, LEVELS)
    assert tank.level == pytest.approx(0.1 * SETTINGS.refill_fraction)
    for _ in range(1000):
        tank = advance(tank, damped, LEVELS)
    assert tank.level == SETTINGS.capacity


def test_sampling_errors_are_paid_from_the_reserve_and_restored_first():
    """Energy that the impedance itself injects costs reserve, then springs, never decoupling."""
    quarter = 0.25 * SETTINGS.reserve
    injects, absorbs = (STILL._replace(other_work=work) for work in (quarter, -quarter))
    tank, shares = full_tank(LEVELS, 0.0), []
    for interval in (injects, injects, injects, absorbs, absorbs):
        tank = advance(tank, interval, LEVELS)
        assert tank.level == SETTINGS.initial
        shares.append(tank.nu)
    np.testing.assert_allclose(shares, [1.0, 1.0, 0.5, 1.0, 1.0])


def test_references_that_come_and_go_are_credited_once():
    """Bringing energy, taking it back and bringing it again grants the credit of one."""
    tank = full_tank(LEVELS, 0.0)
    for potential in (0.3, 0.0, 0.3, 0.0, 0.3):
        jump = STILL._replace(arrived=tank.potential, potential=potential, storage=potential)
        tank = advance(tank, jump, LEVELS)
    assert tank.granted == pytest.approx(0.3 * SETTINGS.reference_credit)


def test_an_operator_refill_opens_the_gate_at_its_own_rate():
    """`refill` fills tank and reserve and says what it granted; sigma rises, it does not step."""
    tank = refill(tank_with(-0.1, reserve=0.0, sigma=0.0, nu=0.0), LEVELS)
    assert (tank.level, tank.reserve) == (SETTINGS.capacity, SETTINGS.reserve)
    assert tank.refilled == pytest.approx(SETTINGS.capacity + 0.1 + SETTINGS.reserve)
    tank = advance(tank, STILL, LEVELS)
    assert tank.sigma == pytest.approx(SETTINGS.opening_rate * STILL.step)


def test_a_change_waits_until_the_tank_can_pay():
    """Costs beyond the open tank are paid in shares; a return of energy is free."""
    tank = full_tank(LEVELS, 0.0)
    spare = tank.level - SETTINGS.full_gate
    assert affordable(tank, 4.0 * spare, LEVELS) == pytest.approx(0.25)
    assert affordable(tank, -1.0, LEVELS) == 1.0
    assert affordable(tank_with(0.1), 1.0, LEVELS) == 0.0


def test_a_spring_is_revalued_without_loss():
    """A stiffer spring is paid from the tank, a softer one gives back to the reserve."""
    tank = full_tank(LEVELS, 0.5)
    stiffer = revalue(tank, 0.8)
    assert stiffer.level == pytest.approx(tank.level - 0.3)
    softer = revalue(stiffer, 0.1)
    assert softer.reserve == pytest.approx(tank.reserve + 0.7)
    for item in (stiffer, softer):
        assert held(item) == pytest.approx(held(tank), abs=1e-15)


def test_an_account_without_gates_has_whole_springs():
    """For a law without gates springs are whole, sigma goes on, and the balance is the same."""
    tank = full_tank(LEVELS, 0.5)._replace(nu=0.3, sigma=0.4, damping=0.2)
    found = whole(tank, full_tank(LEVELS, 0.5))
    assert (found.nu, found.damping, found.sigma) == (1.0, 1.0, 0.4)
    assert held(found) == pytest.approx(held(tank), abs=1e-15)


def test_new_sums_grant_nothing():
    """After a discontinuity of states, energies, gates and the references' debt go on."""
    tank = full_tank(LEVELS, 0.0)._replace(level=0.3, reserve=-0.5, nu=0.0, sigma=0.2, owed=0.4)
    for potential in (0.3, 0.0):
        led = STILL._replace(arrived=tank.potential, potential=potential, storage=1.0)
        tank = advance(tank._replace(nu=1.0), led, LEVELS)
    found = carry(tank, LEVELS, 0.1, 0.0)
    same = ("level", "reserve", "sigma", "nu", "damping", "dampers", "owed")
    assert [getattr(found, name) for name in same] == [getattr(tank, name) for name in same]
    again = found._replace(nu=1.0, potential=0.0)
    bringing = STILL._replace(potential=0.3, storage=1.0)
    after = advance(again, bringing, LEVELS)
    assert after.granted == pytest.approx(0.0)  # The same 0.3 J came and went before.


def test_springs_that_a_limit_loosens_come_back():
    """Energy of yielding springs waits in the reserve, beyond its capacity, for their return."""
    tank = full_tank(LEVELS, 0.0)
    brought = 0.0
    for potential in (1.0, 2.0, 4.0):
        stretched = STILL._replace(
            other_work=-tank.nu * (potential - tank.potential),
            arrived=potential,
            potential=potential,
        )
        brought += tank.nu * (potential - tank.potential)
        tank = advance(tank, stretched, LEVELS)
        assert tank.nu == 1.0
        tank = loosen(tank, 1.0 / potential)
    assert held(tank) == pytest.approx(SETTINGS.initial + SETTINGS.reserve + brought)
    for potential in (2.0, 1.0, 0.0):
        back = STILL._replace(
            other_work=-tank.nu * (potential - tank.potential),
            arrived=potential,
            potential=potential,
        )
        tank = advance(tank, back, LEVELS)
        assert tank.nu == 1.0
        tank = loosen(tank, min(1.0, 1.0 / max(potential, 1.0)))
    assert held(tank) <= SETTINGS.initial + SETTINGS.reserve + brought
    assert tank.reserve >= SETTINGS.reserve


def test_a_debt_is_repaid_by_the_dampers():
    """With nothing left in the reserve springs hold nothing, dampers do, and fill it again."""
    tank = tank_with(1.0, reserve=-3.0)._replace(potential=1.0)
    tank = advance(tank, STILL._replace(arrived=1.0, potential=1.0), LEVELS)
    assert (tank.nu, tank.damping) == (0.0, 1.0)
    damping = STILL._replace(other_work=-1.0, damped=1.0, arrived=1.0, potential=1.0)
    for _ in range(6):
        tank = advance(tank, damping, LEVELS)
    assert tank.nu == 1.0


def test_dampers_that_feed_a_motion_let_go_and_come_back_when_they_damp():
    """Energy fed by late torques is bounded by the reserve; a share of them is judged."""
    tank = full_tank(LEVELS, 0.0)
    for _ in range(100):
        tank = advance(tank, STILL._replace(damped=-0.1, other_work=0.1 * tank.damping), LEVELS)
    assert tank.damping < 1e-3
    assert tank.reserve > -SETTINGS.reserve
    for _ in range(400):
        tank = advance(tank, STILL._replace(damped=0.1), LEVELS)
    assert tank.damping == 1.0


def test_margins_that_reach_further_out_are_paid():
    """The potential of a joint limit is stored, and its growth is the tank's."""
    tank = full_tank(LEVELS, 0.0)
    deeper = deepen(tank, 0.2)
    assert deeper.level == pytest.approx(tank.level - 0.2)
    assert held(deeper) == pytest.approx(held(tank))
    pushed = advance(deeper, STILL._replace(other_work=0.2, margins=0.0), LEVELS)
    assert held(pushed) == pytest.approx(held(deeper) - 0.2)
    assert pushed.reserve == tank.reserve


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
        tank = advance(tank, STILL, LEVELS)
    assert tank.sigma == 0.5
    return tank


def test_a_gate_that_has_closed_stays_until_the_tank_has_regained_its_level():
    """Sigma falls with the tank and rises again only from the reopening level on."""
    tank = closed_by_half()
    short = SETTINGS.reopening_level - tank.level
    for share, open_again in ((0.9, False), (0.2, True)):
        damped = -share * short / SETTINGS.refill_fraction
        tank = advance(tank, STILL._replace(other_work=damped), LEVELS)
        assert (tank.sigma > 0.5) == open_again
        assert (tank.level >= SETTINGS.reopening_level) == open_again


def test_what_the_decoupling_returns_does_not_reopen_its_gate():
    """A loan that comes back fills the tank to the brim, and sigma stays until more comes in."""
    tank = advance(closed_by_half(), STILL._replace(decoupling_work=-10.0), LEVELS)
    assert tank.level == SETTINGS.capacity
    assert tank.sigma == 0.5
    quantum = SETTINGS.reopening_level - SETTINGS.full_gate
    damped = STILL._replace(other_work=-1.01 * quantum / SETTINGS.refill_fraction)
    led = STILL._replace(led=1.01 * quantum, storage=10.0)
    assert advance(tank, damped, LEVELS).sigma > 0.5
    assert advance(tank, led, LEVELS).sigma > 0.5
    assert advance(refill(tank, LEVELS), STILL, LEVELS).sigma > 0.5


def test_a_demand_beyond_a_full_tank_owes_nothing():
    """A gate that a short peak of power has closed opens when the peak is over."""
    tank = advance(tank_with(SETTINGS.capacity), STILL._replace(demand=1000.0), LEVELS)
    assert tank.sigma < 1.0
    assert advance(tank, STILL, LEVELS).sigma > tank.sigma


def test_reopenings_are_bounded_by_what_came_in():
    """For any exchange of energy, each reopening after a shortage costs a whole quantum."""
    tank, came_in, reopenings, falling = tank_with(1.0), 0.0, 0, True
    rng = np.random.default_rng(11)
    for _ in range(30_000):
        lent = float(rng.normal(0.1 * (tank.level - 0.6), 0.2))
        damped = float(rng.uniform(0.0, 0.02))
        booked = STILL._replace(decoupling_work=lent, other_work=-damped)
        after = advance(tank, booked, LEVELS)
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
        impedance = decoupling = damped = np.zeros(2)
        start, e_last = 0.0, self.J @ state[:2]
        for _ in range(round(seconds / self.period)):
            e, e_rate = self.J @ state[:2], self.J @ state[2:]
            potential = 0.5 * e @ (self.K * e)
            kinetic = 0.5 * e_rate @ self.inertia @ e_rate
            pull = -(self.D * e_rate + self.K * e)
            if tank is None:
                tank = full_tank(LEVELS, potential)
                start = held(tank) + kinetic + self.environment(state[:2])
            else:
                moved = e - e_last
                demand = e_rate @ self.coupling @ pull
                interval = Interval(
                    step=self.period,
                    decoupling_work=float(decoupling @ moved),
                    other_work=float(impedance @ moved),
                    damped=float(damped @ moved),
                    arrived=potential,
                    potential=potential,
                    margins=0.0,
                    led=0.0,
                    storage=kinetic + potential,
                    demand=demand,
                )
                tank = advance(tank, interval, LEVELS)
            sigma, nu = (tank.sigma, tank.nu) if gated else (1.0, 1.0)
            damped = self.D * e_rate
            impedance = -(damped + nu * self.K * e)
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
