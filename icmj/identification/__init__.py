"""The inverse question: which model error made the motion that was measured."""
