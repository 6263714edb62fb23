"""Everything that touches rerun: writing, reading and replaying a log."""
