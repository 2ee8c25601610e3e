"""The commands `handover study ...`, a file for what belongs together; `group.py` names them."""
