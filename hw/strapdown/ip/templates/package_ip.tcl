# Has Vivado package {{ name }} from its Verilog, into the folder packaged beside this file:
#
#   vivado -mode batch -source package_ip.tcl
#
# component.xml beside this file describes the same core and needs no such step. Use this one to let Vivado infer the
# interfaces, compute checksums and check the result.

set name {{ name }}
set here [file normalize [file dirname [info script]]]
set packaged [file join $here packaged]

# Name, offset, and the fields: name, lowest bit, bits, access.
set registers {
{% for register in registers %}
    {{ '{' }}{{ register.name }} {{ '0x%03X' % register.address }}{% for field in register.fields %} { {{- field.name }} {{ field.low }} {{ field.width }} {{ access[field.access] -}} }{% endfor %}}
{% endfor %}
}

create_project -force $name [file join $here build package] -part {{ part }}
add_files -norecurse [file join $here {{ places.verilog }}]
add_files -fileset constrs_1 -norecurse [file join $here {{ places.clock_alone }}]
set_property USED_IN {out_of_context synthesis implementation} [get_files [file join $here {{ places.clock_alone }}]]
set_property top $name [current_fileset]
update_compile_order -fileset sources_1

ipx::package_project -root_dir $packaged -vendor {{ vlnv.vendor }} -library {{ vlnv.library }} -taxonomy /UserIP \
    -import_files -set_current true -force
set core [ipx::current_core]
set_property name $name $core
set_property version {{ vlnv.version }} $core
set_property display_name {{ display | word }} $core
set_property vendor_display_name {{ vlnv.vendor }} $core
set_property description {{ description | word }} $core
set_property supported_families {{ '{' }}{% for family in families %}{{ family }} Production{{ ' ' if not loop.last }}{% endfor %}} $core

# Vivado infers the AXI interfaces, the clock and the reset from the names of the ports.
ipx::infer_bus_interface irq xilinx.com:signal:interrupt_rtl:1.0 $core
set irq [ipx::get_bus_interfaces irq -of_objects $core]
ipx::add_bus_parameter SENSITIVITY $irq
set_property value LEVEL_HIGH [ipx::get_bus_parameters SENSITIVITY -of_objects $irq]
{% for bus in buses %}
ipx::associate_bus_interfaces -busif {{ bus }} -clock aclk $core
{% endfor %}
ipx::associate_bus_interfaces -clock aclk -reset aresetn $core

set map [ipx::get_memory_maps s_axi -of_objects $core]
set block [ipx::get_address_blocks {{ block }} -of_objects $map]
set_property range {{ size }} $block
foreach entry $registers {
    set register [ipx::add_register [lindex $entry 0] $block]
    set_property address_offset [lindex $entry 1] $register
    set_property size 32 $register
    foreach description [lrange $entry 2 end] {
        lassign $description title low width access
        set field [ipx::add_field $title $register]
        set_property bit_offset $low $field
        set_property bit_width $width $field
        set_property access $access $field
    }
}

ipx::create_xgui_files $core
ipx::update_checksums $core
ipx::check_integrity $core
ipx::save_core $core
close_project
puts "Packaged {{ vlnv }} in $packaged"
