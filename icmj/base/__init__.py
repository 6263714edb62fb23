"""The lowest floor: arrays, polynomials, complete files, plain data. It imports only errors."""
