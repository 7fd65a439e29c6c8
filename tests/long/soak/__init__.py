"""The endurance run: thousands of faults on emulated robots, judged by the true motion of their wheels."""
