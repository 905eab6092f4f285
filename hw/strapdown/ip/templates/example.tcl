# Example design of {{ name }} on a Zynq board, from its block design to the bitstream:
#
#   vivado -mode batch -source example.tcl -tclargs BOARD ?MHZ?
#
# BOARD is pynq-z2 or zedboard; MHZ is the clock of the core, 100 unless given. The processor reaches the registers of
# the core through M_AXI_GP0{% if streams %}, a DMA engine moves samples and answers through S_AXI_HP0{% endif %}, and the
# interrupt of the core is IRQ_F2P. Results are in build/BOARD: bitstream, .hwh, .xsa and reports.

set name {{ name }}
set here [file normalize [file dirname [info script]]]

# Pattern of the board files, and part.
set boards {
    pynq-z2  {tul.com.tw:pynq-z2:part0:1.0 xc7z020clg400-1}
    zedboard {em.avnet.com:zed:part0:* xc7z020clg484-1}
}

# Ends the script with a sentence.
proc stop {sentence} {
    puts stderr "example.tcl: $sentence"
    exit 1
}

# The newest version of a core in the catalogue.
proc newest {pattern} {
    set found [lsort -dictionary [get_ipdefs -all $pattern]]
    if {[llength $found] == 0} {
        stop "the IP catalogue of this Vivado has no $pattern"
    }
    return [lindex $found end]
}

# A cell of the newest version of a core.
proc cell {title pattern} {
    return [create_bd_cell -type ip -vlnv [newest $pattern] $title]
}

# Connects pins to a source.
proc connect {source args} {
    foreach pin $args {
        connect_bd_net [get_bd_pins $source] [get_bd_pins $pin]
    }
}

# Connects two interfaces.
proc join_interfaces {from to} {
    connect_bd_intf_net [get_bd_intf_pins $from] [get_bd_intf_pins $to]
}

set board [lindex $argv 0]
set mhz [expr {[llength $argv] > 1 ? [lindex $argv 1] : 100}]
if {![dict exists $boards $board]} {
    stop "name a board, as in: vivado -mode batch -source example.tcl -tclargs pynq-z2. Boards: [dict keys $boards]"
}
lassign [dict get $boards $board] pattern part
set found [lsort -dictionary [get_board_parts -quiet $pattern]]
if {[llength $found] == 0} {
    stop "this Vivado has no board files $pattern: install them with Tools, Vivado Store, Boards, or name their folder in board.repoPaths"
}

set folder [file join $here build $board]
create_project -force $name [file join $folder project] -part $part
set_property board_part [lindex $found end] [current_project]
set_property ip_repo_paths [list $here] [current_project]
update_ip_catalog

create_bd_design system
cell ps7 xilinx.com:ip:processing_system7:*
apply_bd_automation -rule xilinx.com:bd_rule:processing_system7 \
    -config {make_external "FIXED_IO, DDR" apply_board_preset 1 Master Disable Slave Disable} [get_bd_cells ps7]
set_property -dict [list CONFIG.PCW_USE_M_AXI_GP0 1 CONFIG.PCW_USE_S_AXI_HP0 {{ '1' if streams else '0' }} \
    CONFIG.PCW_USE_FABRIC_INTERRUPT 1 CONFIG.PCW_IRQ_F2P_INTR 1 \
    CONFIG.PCW_FPGA0_PERIPHERAL_FREQMHZ $mhz] [get_bd_cells ps7]
cell core {{ vlnv }}
cell reset xilinx.com:ip:proc_sys_reset:*
cell control xilinx.com:ip:smartconnect:*
set_property -dict [list CONFIG.NUM_SI 1 CONFIG.NUM_MI {{ '2' if streams else '1' }} CONFIG.NUM_CLKS 1] [get_bd_cells control]
{% if streams %}
cell dma xilinx.com:ip:axi_dma:*
set_property -dict [list CONFIG.c_include_sg 0 CONFIG.c_sg_length_width 26 \
    CONFIG.c_include_mm2s 1 CONFIG.c_m_axi_mm2s_data_width 32 CONFIG.c_m_axis_mm2s_tdata_width 32 \
    CONFIG.c_include_s2mm 1 CONFIG.c_m_axi_s2mm_data_width 32] [get_bd_cells dma]
cell data xilinx.com:ip:smartconnect:*
set_property -dict [list CONFIG.NUM_SI 2 CONFIG.NUM_MI 1 CONFIG.NUM_CLKS 1] [get_bd_cells data]
{% endif %}

connect ps7/FCLK_CLK0 ps7/M_AXI_GP0_ACLK core/aclk reset/slowest_sync_clk control/aclk
connect ps7/FCLK_RESET0_N reset/ext_reset_in
connect reset/peripheral_aresetn core/aresetn control/aresetn
connect core/irq ps7/IRQ_F2P
join_interfaces ps7/M_AXI_GP0 control/S00_AXI
join_interfaces control/M00_AXI core/s_axi
{% if streams %}
connect ps7/FCLK_CLK0 ps7/S_AXI_HP0_ACLK dma/s_axi_lite_aclk dma/m_axi_mm2s_aclk dma/m_axi_s2mm_aclk data/aclk
connect reset/peripheral_aresetn dma/axi_resetn data/aresetn
join_interfaces control/M01_AXI dma/S_AXI_LITE
join_interfaces dma/M_AXIS_MM2S core/s_axis
join_interfaces core/m_axis dma/S_AXIS_S2MM
join_interfaces dma/M_AXI_MM2S data/S00_AXI
join_interfaces dma/M_AXI_S2MM data/S01_AXI
join_interfaces data/M00_AXI ps7/S_AXI_HP0
{% endif %}

assign_bd_address -offset {{ '0x%08X' % address }} -range 4K -target_address_space [get_bd_addr_spaces ps7/Data] \
    [get_bd_addr_segs core/s_axi/{{ block }}]
{% if streams %}
assign_bd_address -offset 0x40400000 -range 64K -target_address_space [get_bd_addr_spaces ps7/Data] \
    [get_bd_addr_segs dma/S_AXI_LITE/Reg]
foreach space {dma/Data_MM2S dma/Data_S2MM} {
    assign_bd_address -target_address_space [get_bd_addr_spaces $space] \
        [get_bd_addr_segs ps7/S_AXI_HP0/HP0_DDR_LOWOCM]
}
{% endif %}
validate_bd_design
save_bd_design

set wrapper [make_wrapper -files [get_files system.bd] -top]
add_files -norecurse $wrapper
set_property top system_wrapper [current_fileset]
update_compile_order -fileset sources_1

launch_runs impl_1 -to_step write_bitstream -jobs 2
wait_on_run impl_1
if {[get_property PROGRESS [get_runs impl_1]] ne "100%"} {
    stop "the implementation failed: see [get_property DIRECTORY [get_runs impl_1]]/runme.log"
}
open_run impl_1
report_utilization -hierarchical -file [file join $folder utilization_by_cell.rpt]
report_utilization -file [file join $folder utilization.rpt]
report_timing_summary -file [file join $folder timing.rpt]
if {[get_property SLACK [get_timing_paths -setup]] < 0} {
    puts stderr "example.tcl: the design is too slow for $mhz MHz: give a lower clock as the second argument"
}

file copy -force [file join [get_property DIRECTORY [get_runs impl_1]] system_wrapper.bit] [file join $folder $name.bit]
# Vivado writes the handoff beside the generated files; before 2020.2, beside the sources.
set handoff [glob [file join $folder project $name.{gen,srcs} sources_1 bd system hw_handoff system.hwh]]
file copy -force [lindex $handoff 0] [file join $folder $name.hwh]
write_hw_platform -fixed -include_bit -force -file [file join $folder $name.xsa]
puts "Wrote $name.bit, $name.hwh, $name.xsa and reports to $folder"
