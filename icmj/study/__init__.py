"""Every case on both plants, into logs, a report and a summary."""
