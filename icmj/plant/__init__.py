"""The linear plant as data."""
