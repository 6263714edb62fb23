"""The data of a run and its prediction that are shown, as plain arrays; other modules draw them."""
