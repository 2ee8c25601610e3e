"""For all tests: no property is tested by the clock, and Ctrl-C is heard, whatever started the tests."""

import signal

from hypothesis import settings

settings.register_profile("without deadline", deadline=None)
settings.load_profile("without deadline")

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # as of a shell's job in the background
    signal.signal(signal.SIGINT, signal.default_int_handler)
