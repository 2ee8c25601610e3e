"""Units in processes of their own: a program that loads a unit, and a library that has it make the calls."""
