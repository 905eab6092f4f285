"""cocotb benches. They run inside the simulator; strapdown_sim.drivers.bench starts them."""
