"""The run file: one TOML file that says everything about a case, validated on load."""
