"""Parts of a real control loop: delays, rounding, filters, noise, limits.

loop       `Loop`: a controller with delays and blocks, and what happens at each of its ticks
block      base class of blocks; `Quantisation`, `Noise`, `RateLimit`, `Differences`
low_pass   `LowPass`
"""
