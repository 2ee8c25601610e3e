"""What tests of several folders share; the one folder of helper modules that is on the path."""
