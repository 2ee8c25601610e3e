"""Pages of many runs beside each other, and films of one."""
