"""Push the standing person of a run file and watch the open-loop intervals recover.

Run from the folder of the checkout: python examples/disturbed_stance.py
"""

from pathlib import Path

import icmj

path = Path("runs/three-link-0.9.toml")
push = """
[[simulation.disturbance]]
kind = "impulse"                # N m s at the ankle, spread over 50 ms
input = "ankle_torque"
size = 0.5
start = 15.0
"""
run = icmj.parse_run(path.read_text(encoding="utf-8") + push, path)
case = icmj.prepare(run)
simulation = icmj.simulate(case, "mujoco")
for t, interval in zip(simulation.events.t, simulation.events.interval, strict=True):
    if t > 12:
        print(f"{t:7.3f} s   interval {interval:.4f} s   {'#' * round(60 * interval)}")
print(icmj.measure(simulation, T_hat=case.system.T_hat).words)
