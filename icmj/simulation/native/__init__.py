"""What both simulators run in compiled code: a controller that reads outputs of a while ago."""
