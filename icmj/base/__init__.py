"""The lowest floor: arrays, polynomials, complete files, plain data. It imports only errors.

The version of icmj is here and nowhere else; the build reads it from here.
"""

VERSION = "0.1.0"
