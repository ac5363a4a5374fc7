# SPDX-License-Identifier: Apache-2.0
"""Section V without ROS at three rates: error of order 1 against the closed form."""

import numpy as np
from scipy.integrate import solve_ivp

from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.files import find_scenario, read_parameters
from noninteract_ros.scenario.rehearsal import History, rehearse

DURATION, START = 6.0, 4.0  # s; the human input begins at START
RATES = (250.0, 500.0, 1000.0)  # Hz


def cooperative(t: float, y: np.ndarray) -> np.ndarray:
    """Return the state's rate: (3 + 1) x'' = 3 x_d'' - 53 e' - 25 e, with the object's 1 kg."""
    x, x_rate = y.reshape(2, 2)
    sine, cosine = 2.0 * np.sin(0.79 * t), 2.0 * np.cos(0.79 * t)
    e = x - np.array([sine, 1.0])
    e_rate = x_rate - np.array([0.79 * cosine, 0.0])
    desired = np.array([-(0.79**2) * sine, 0.0])
    return np.concatenate((x_rate, (3.0 * desired - 53.0 * e_rate - 25.0 * e) / 4.0))


def relative(t: float, y: np.ndarray) -> np.ndarray:
    """Return the state's rate: 0.75 e'' + 25 e' + (50 + 20) e = 0, with the object's 20 N/m."""
    x, x_rate = y.reshape(2, 2)
    return np.concatenate((x_rate, -(25.0 * x_rate + 70.0 * (x - 1.0)) / 0.75))


def deviation(history: History, part: slice, rates: object, start: float) -> float:
    """Return the largest distance from the closed form with the same initial state [m]."""
    first = int(np.searchsorted(history.t, start - 1e-9))
    t, x = history.t[first:], history.x[first:, part]
    y0 = np.concatenate((x[0], history.x_rate[first, part]))
    exact = solve_ivp(rates, t[[0, -1]], y0, method="DOP853", t_eval=t, rtol=1e-10, atol=1e-12)
    return float(np.abs(x - exact.y[:2].T).max())


def main() -> None:
    values = read_parameters(find_scenario("paper"))
    print("  rate [Hz]   cooperative [m]   relative [m]   lowest storage [J]")
    for rate in RATES:
        history = rehearse(Scenario.from_dict(values | {"rate": rate}), DURATION)
        error_c = deviation(history, slice(0, 2), cooperative, START)
        error_r = deviation(history, slice(2, 4), relative, 0.0)
        print(f"{rate:11.0f} {error_c:17.2e} {error_r:14.2e} {history.storage.min():20.2e}")
    rate_c, rate_r = history.storage_rate.max(axis=0)
    print(f"Fastest growth of a storage: cooperative {rate_c:.2f} W, relative {rate_r:.2f} W")


if __name__ == "__main__":
    main()
