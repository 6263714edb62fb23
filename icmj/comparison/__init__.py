"""Prediction and measurement side by side: numbers, and a verdict in words."""
