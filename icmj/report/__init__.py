"""The comparison report: figures, sections, page. Built from logs alone."""
