"""Parts of a real control loop: delays, rounding, filters, noise, limits.

loop       `Loop`: a controller with delays and blocks, and the computations at a tick
block      base class of blocks; `Quantisation`, `Noise`, `RateLimit`, `Differences`
low_pass   `LowPass`
"""
