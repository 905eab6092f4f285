# Clock of {{ name }} while it is synthesised alone (out_of_context): 100 MHz. In a design, the clock comes from there.
create_clock -name aclk -period 10.000 [get_ports aclk]
