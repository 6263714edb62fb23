"""The controller as data: gains, hold, trigger, and the states that it runs with."""
