"""An FMU as a file: its archive and libraries, and what its model description says, alike for FMI 2 and FMI 3."""
