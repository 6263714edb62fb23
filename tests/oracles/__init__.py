"""Independent oracles: what tests prove the simulators against.

Nothing here shares a formula with `icmj/`: each is written from the equations of the paper, or is another method of
somebody else's (SciPy, numpy). Where an oracle takes numbers of icmj (a design's matrices, an operating point), others
prove these.

- :mod:`oracles.engine`: a flight on MuJoCo by SciPy's DOP853 on ``mj_forward`` of the bare plant; rates of a composed
  model by ``mj_forward``; extremes of a smooth signal by SciPy.

The naive loop, Euler steps with a callback that looks for events once a step, is `benchmarks/naive_loop.py`.
"""
