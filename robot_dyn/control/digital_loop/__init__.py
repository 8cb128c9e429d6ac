"""The loop of a real controller: delays, quantisation, filters, noise, rates."""
