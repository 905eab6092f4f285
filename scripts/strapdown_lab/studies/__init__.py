"""Studies: filters and navigators on recordings, and over millions of updates."""
