"""FMI 3 event mode and clocks, and steps that end before their time."""
