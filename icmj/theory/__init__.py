"""The linear theory: error system, eigenvalue crossings, orbit, return map, prediction. Imports no engine."""
