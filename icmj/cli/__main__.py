"""``python -m icmj.cli`` is ``icmj``."""

from icmj.cli.main import entry

if __name__ == "__main__":
    entry()
