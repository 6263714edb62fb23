"""The double-step experiment: pairs of steps, reaction times, and the kinds of controller that explain them."""
