"""Resources and speed of operators and cores, and of the best public ones: measurements, tables and plots."""
