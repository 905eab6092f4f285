"""What operators and cores cost, beside the best public ones: measured, tabulated, drawn."""
