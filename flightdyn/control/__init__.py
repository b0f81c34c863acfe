"""Following a planned trajectory: feed-forward of its controls and a time-varying LQR."""
