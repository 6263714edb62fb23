"""What everything stands on: arrays, polynomials, whole files, plain data. Imports nothing but errors."""
