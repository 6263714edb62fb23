"""Everything that touches MuJoCo: models, linearisation, callbacks, the closed loop, poses."""
