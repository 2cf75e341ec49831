"""Device drivers: simulated, replayed and real, behind the same protocols."""
