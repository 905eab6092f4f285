# Stubs of the Tcl commands of Vivado and of ISE that scripts of a package call: tclsh vivado.tcl FACTS CALLS SCRIPT ARGS
#
# FACTS sets the dict facts: what component.xml says of the core, and the boards of this "Vivado". Every call is checked
# and written to the file CALLS. An unknown command, option, property or part, a missing file, an object that does not
# exist, and a design with open ends are errors. The stubs know only what the scripts use.

namespace eval ipx {}
namespace eval ipgui {}
namespace eval stub {
    variable calls {} files {} cells {} nets {} joins {} segments {} properties {} registers {} associations {}
    variable catalogue {
        xilinx.com:ip:processing_system7:5.5 xilinx.com:ip:axi_dma:7.0 xilinx.com:ip:axi_dma:7.1
        xilinx.com:ip:proc_sys_reset:5.0 xilinx.com:ip:smartconnect:1.0}
    variable parts {xc7z020clg400-1 xc7z020clg484-1}
    # Properties that can be set, by kind of object.
    variable settable {
        project {part board_part ip_repo_paths source_mgmt_mode} fileset {top include_dirs} file {USED_IN}
        core {name version display_name vendor_display_name description supported_families}
        block {range} register {address_offset size} field {bit_offset bit_width access} parameter {value}
        processing_system7 {CONFIG.PCW_USE_M_AXI_GP0 CONFIG.PCW_USE_S_AXI_HP0 CONFIG.PCW_USE_FABRIC_INTERRUPT
            CONFIG.PCW_IRQ_F2P_INTR CONFIG.PCW_FPGA0_PERIPHERAL_FREQMHZ}
        smartconnect {CONFIG.NUM_SI CONFIG.NUM_MI CONFIG.NUM_CLKS}
        axi_dma {CONFIG.c_include_sg CONFIG.c_sg_length_width CONFIG.c_include_mm2s CONFIG.c_m_axi_mm2s_data_width
            CONFIG.c_m_axis_mm2s_tdata_width CONFIG.c_include_s2mm CONFIG.c_m_axi_s2mm_data_width}}
}

# Defines a command: flags, options with a value, least and greatest number of other words. The body sees options, rest.
proc ::stub::command {name flags valued least most body} {
    proc ::$name args "lassign \[::stub::parse [list $name $flags $valued $least $most] \$args\] options rest\n$body"
}

proc ::stub::parse {name flags valued least most words} {
    variable calls
    lappend calls [list $name {*}$words]
    set options {}
    set rest {}
    while {[llength $words]} {
        set words [lassign $words word]
        set option [string range $word 1 end]
        if {![string match -* $word] || [string is double $word]} {
            lappend rest $word
        } elseif {$option in $flags} {
            dict set options $option 1
        } elseif {$option in $valued && [llength $words]} {
            set words [lassign $words value]
            dict set options $option $value
        } else {
            error "$name: unknown option $word, or no value after it"
        }
    }
    if {[llength $rest] < $least || [llength $rest] > $most} {
        error "$name takes $least to $most words, not [llength $rest]"
    }
    return [list $options $rest]
}

proc ::stub::must {condition message} {
    if {![uplevel 1 [list expr $condition]]} {
        error [uplevel 1 [list subst $message]]
    }
}

# An object, as KIND:NAME, and its parts.
proc ::stub::kind {object} { return [lindex [split $object :] 0] }
proc ::stub::name {object} { return [join [lrange [split $object :] 1 end] :] }
proc ::stub::object {kind name known} {
    must {$name in $known} {there is no $kind $name}
    return $kind:$name
}
proc ::stub::expect {kind object} { must {[kind $object] eq $kind} {not a $kind: $object} }
proc ::stub::value {object property {default {}}} {
    variable properties
    return [expr {[dict exists $properties $object $property] ? [dict get $properties $object $property] : $default}]
}

# Files and projects

::stub::command create_project {force} {part} 1 2 {
    if {[dict exists $options part]} {
        ::stub::must {[dict get $options part] in $::stub::parts} {unknown part [dict get $options part]}
    }
    lassign [concat $rest .] ::stub::project ::stub::directory
    file mkdir $::stub::directory
}
::stub::command close_project {} {} 0 0 { unset ::stub::project }
::stub::command current_project {} {} 0 0 { return project:$::stub::project }
::stub::command current_fileset {} {} 0 0 { return fileset:sources_1 }
::stub::command add_files {norecurse} {fileset} 1 1 {
    set set [expr {[dict exists $options fileset] ? [dict get $options fileset] : "sources_1"}]
    ::stub::must {$set in {sources_1 constrs_1}} {there is no fileset $set}
    foreach file [lindex $rest 0] {
        ::stub::must {[file isfile $file]} {there is no file $file}
        lappend ::stub::files $file
    }
}
::stub::command read_verilog {} {} 1 1 { add_files [lindex $rest 0] }
::stub::command read_xdc {} {} 1 1 { add_files -fileset constrs_1 [lindex $rest 0] }
::stub::command get_filesets {} {} 1 1 { return [::stub::object fileset [lindex $rest 0] {sources_1 constrs_1}] }
::stub::command get_files {} {} 1 1 {
    return [lmap file $::stub::files {
        if {$file ne [lindex $rest 0] && [file tail $file] ne [lindex $rest 0]} continue
        set file file:$file}]
}
::stub::command update_compile_order {} {fileset} 0 0 {
    ::stub::must {[dict get $options fileset] eq "sources_1"} {there is no such fileset}
    set top [::stub::value fileset:sources_1 top]
    ::stub::must {$top in [lmap file $::stub::files {file rootname [file tail $file]}]} {no file holds the top $top}
}
::stub::command set_property {dict} {} 2 3 {
    if {[dict exists $options dict]} {
        lassign $rest pairs objects
    } else {
        ::stub::must {[llength $rest] == 3} {set_property takes a name, a value and objects}
        set pairs [lrange $rest 0 1]
        set objects [lindex $rest 2]
    }
    ::stub::must {[llength $objects]} {set_property has no objects}
    foreach object $objects {
        set kind [expr {[::stub::kind $object] eq "cell" ? [::stub::ip [::stub::name $object]] : [::stub::kind $object]}]
        foreach {property value} $pairs {
            ::stub::must {[dict exists $::stub::settable $kind] && $property in [dict get $::stub::settable $kind]} \
                {$object has no property $property}
            if {$property eq "board_part"} {
                ::stub::must {$value in [dict get $::stub::facts boards]} {there is no board $value}
            }
            if {$property eq "part"} { ::stub::must {$value in $::stub::parts} {unknown part $value} }
            if {$property eq "USED_IN"} {
                foreach use $value {
                    ::stub::must {$use in {synthesis implementation out_of_context}} {a file cannot be used in $use}
                }
            }
            dict set ::stub::properties $object $property $value
        }
    }
}
::stub::command get_property {} {} 2 2 {
    lassign $rest property object
    switch [::stub::kind $object]/$property {
        run/PROGRESS { return [dict get $::stub::facts progress] }
        run/DIRECTORY { return [file join $::stub::directory $::stub::project.runs [::stub::name $object]] }
        path/SLACK { return [dict get $::stub::facts slack] }
        default { error "$object has no property $property" }
    }
}

# The packager

::stub::command ipx::package_project {import_files force} {root_dir vendor library taxonomy set_current} 0 0 {
    ::stub::must {[::stub::value fileset:sources_1 top] eq [dict get $::stub::facts name]} {the top is not set}
    foreach option {root_dir vendor library} { dict get $options $option }
    # Vivado infers clock, reset and AXI interfaces by the names of the ports.
    set ::stub::inferred [lsearch -all -inline -not -exact [dict keys [dict get $::stub::facts interfaces]] irq]
    lappend ::stub::inferred {*}[lsearch -all -inline -regexp [dict keys [dict get $::stub::facts pins]] {^(aclk|aresetn)$}]
}
::stub::command ipx::current_core {} {} 0 0 { return core:[dict get $::stub::facts name] }
::stub::command ipx::infer_bus_interface {} {} 3 3 {
    ::stub::must {[lindex $rest 0] in [dict keys [dict get $::stub::facts pins]]} {there is no port [lindex $rest 0]}
    ::stub::must {[lindex $rest 1] in {xilinx.com:signal:interrupt_rtl:1.0}} {unknown interface [lindex $rest 1]}
    lappend ::stub::inferred [lindex $rest 0]
}
::stub::command ipx::get_bus_interfaces {} {of_objects} 1 1 {
    return [::stub::object interface [lindex $rest 0] $::stub::inferred]
}
::stub::command ipx::add_bus_parameter {} {} 2 2 {
    ::stub::expect interface [lindex $rest 1]
    dict set ::stub::properties parameter:[::stub::name [lindex $rest 1]].[lindex $rest 0] value {}
}
::stub::command ipx::get_bus_parameters {} {of_objects} 1 1 {
    set parameter parameter:[::stub::name [dict get $options of_objects]].[lindex $rest 0]
    ::stub::must {[dict exists $::stub::properties $parameter]} {there is no $parameter}
    return $parameter
}
::stub::command ipx::associate_bus_interfaces {} {busif clock reset} 1 1 {
    ::stub::expect core [lindex $rest 0]
    foreach {option interface} $options {
        ::stub::must {$interface in $::stub::inferred} {there is no interface $interface}
    }
    ::stub::must {[dict get $options clock] eq "aclk"} {[dict get $options clock] is no clock}
    lappend ::stub::associations {*}[dict values [dict remove $options clock]]
}
::stub::command ipx::get_memory_maps {} {of_objects} 1 1 { return [::stub::object map [lindex $rest 0] s_axi] }
::stub::command ipx::get_address_blocks {} {of_objects} 1 1 {
    ::stub::expect map [dict get $options of_objects]
    return [::stub::object block [lindex $rest 0] reg0]
}
::stub::command ipx::add_register {} {} 2 2 {
    ::stub::expect block [lindex $rest 1]
    dict set ::stub::registers [lindex $rest 0] {}
    return register:[lindex $rest 0]
}
::stub::command ipx::add_field {} {} 2 2 {
    ::stub::expect register [lindex $rest 1]
    dict set ::stub::registers [::stub::name [lindex $rest 1]] [lindex $rest 0] {}
    return field:[::stub::name [lindex $rest 1]].[lindex $rest 0]
}
::stub::command ipx::create_xgui_files {} {} 1 1 { ::stub::expect core [lindex $rest 0] }
::stub::command ipx::update_checksums {} {} 1 1 { ::stub::expect core [lindex $rest 0] }
::stub::command ipx::check_integrity {} {} 1 1 {
    foreach interface [concat [dict keys [dict get $::stub::facts interfaces]] aresetn] {
        ::stub::must {$interface in $::stub::associations} {interface $interface has no clock}
    }
    ::stub::must {[::stub::value parameter:irq.SENSITIVITY value] eq "LEVEL_HIGH"} {irq has no sensitivity}
    ::stub::must {[::stub::value block:reg0 range] == [dict get $::stub::facts range]} {the range of reg0 is wrong}
    set found {}
    dict for {register fields} $::stub::registers {
        lappend found [list $register [expr {[::stub::value register:$register address_offset]}] \
            [::stub::value register:$register size] [lmap field [dict keys $fields] {
                list $field {*}[lmap property {bit_offset bit_width access} {
                    ::stub::value field:$register.$field $property}]}]]
    }
    foreach is $found expected [dict get $::stub::facts registers] {
        ::stub::must {$is eq $expected} {register $is is not that of component.xml, $expected}
    }
}
::stub::command ipx::save_core {} {} 1 1 { ::stub::expect core [lindex $rest 0] }

# Block designs

::stub::command get_board_parts {quiet} {} 1 1 {
    return [lsearch -all -inline -glob [dict get $::stub::facts boards] [lindex $rest 0]]
}
::stub::command update_ip_catalog {} {} 0 0 {
    foreach folder [::stub::value project:$::stub::project ip_repo_paths] {
        ::stub::must {[file isfile [file join $folder component.xml]]} {there is no core in $folder}
        lappend ::stub::catalogue [dict get $::stub::facts vlnv]
    }
}
::stub::command get_ipdefs {all} {} 1 1 { return [lsearch -all -inline -glob $::stub::catalogue [lindex $rest 0]] }
::stub::command create_bd_design {} {} 1 1 {
    set ::stub::design [lindex $rest 0]
    lappend ::stub::files [file join $::stub::directory $::stub::design.bd]
}
::stub::command create_bd_cell {} {type vlnv} 1 1 {
    ::stub::must {[dict get $options vlnv] in $::stub::catalogue} {there is no core [dict get $options vlnv]}
    dict set ::stub::cells [lindex $rest 0] [lindex [split [dict get $options vlnv] :] 2]
    return cell:[lindex $rest 0]
}
::stub::command get_bd_cells {} {} 1 1 { return [::stub::object cell [lindex $rest 0] [dict keys $::stub::cells]] }
::stub::command apply_bd_automation {} {rule config} 1 1 {
    ::stub::expect cell [lindex $rest 0]
    ::stub::must {[dict get $options rule] eq "xilinx.com:bd_rule:processing_system7"} {unknown rule}
    ::stub::must {[dict keys [dict get $options config]] eq {make_external apply_board_preset Master Slave}} {
        unknown settings of the rule: [dict get $options config]}
    set ::stub::external [lmap port [split [dict get $options config make_external] ,] {string trim $port}]
}

# Pins of a cell: name to direction, kind and whether it may stay open. Interfaces: name to side, kind and clock.
proc ::stub::ip {cell} { return [dict get $::stub::cells $cell] }
proc ::stub::setting {cell name default} { return [value cell:$cell CONFIG.$name $default] }
proc ::stub::pins {cell} {
    switch [ip $cell] {
        processing_system7 {
            set pins {FCLK_CLK0 {out clock} FCLK_RESET0_N {out reset}}
            if {[setting $cell PCW_USE_M_AXI_GP0 0]} { dict set pins M_AXI_GP0_ACLK {in clock} }
            if {[setting $cell PCW_USE_S_AXI_HP0 0]} { dict set pins S_AXI_HP0_ACLK {in clock} }
            if {[setting $cell PCW_USE_FABRIC_INTERRUPT 0] && [setting $cell PCW_IRQ_F2P_INTR 0]} {
                dict set pins IRQ_F2P {in interrupt}
            }
        }
        proc_sys_reset {
            set pins {slowest_sync_clk {in clock} ext_reset_in {in reset} peripheral_aresetn {out reset}
                interconnect_aresetn {out reset}}
        }
        smartconnect { set pins {aclk {in clock} aresetn {in reset}} }
        axi_dma {
            set pins {s_axi_lite_aclk {in clock} m_axi_mm2s_aclk {in clock} m_axi_s2mm_aclk {in clock}
                axi_resetn {in reset} mm2s_introut {out interrupt} s2mm_introut {out interrupt}}
            if {[setting $cell c_include_sg 1]} { dict set pins m_axi_sg_aclk {in clock} }
        }
        default { set pins [dict get $::stub::facts pins] }
    }
    return $pins
}
proc ::stub::interfaces {cell} {
    set found {}
    switch [ip $cell] {
        processing_system7 {
            if {[setting $cell PCW_USE_M_AXI_GP0 0]} { dict set found M_AXI_GP0 {master aximm M_AXI_GP0_ACLK} }
            if {[setting $cell PCW_USE_S_AXI_HP0 0]} { dict set found S_AXI_HP0 {slave aximm S_AXI_HP0_ACLK} }
        }
        proc_sys_reset {}
        smartconnect {
            foreach {letter side default count} [list S slave 1 [setting $cell NUM_SI 1] M master 1 [setting $cell NUM_MI 1]] {
                for {set index 0} {$index < $count} {incr index} {
                    dict set found [format %s%02d_AXI $letter $index] [list $side aximm aclk]
                }
            }
        }
        axi_dma {
            set found {S_AXI_LITE {slave aximm s_axi_lite_aclk} M_AXI_MM2S {master aximm m_axi_mm2s_aclk}
                M_AXI_S2MM {master aximm m_axi_s2mm_aclk} M_AXIS_MM2S {master axis m_axi_mm2s_aclk}
                S_AXIS_S2MM {slave axis m_axi_s2mm_aclk}}
        }
        default { set found [dict get $::stub::facts interfaces] }
    }
    return $found
}
proc ::stub::place {kind path} {
    lassign [split $path /] cell name
    must {[dict exists $::stub::cells $cell]} {there is no cell $cell}
    return [object $kind $path [lmap known [dict keys [${kind}s $cell]] {set known $cell/$known}]]
}
proc ::stub::pin {object} { lassign [split [name $object] /] cell name; return [dict get [pins $cell] $name] }
proc ::stub::interface {object} { lassign [split [name $object] /] cell name; return [dict get [interfaces $cell] $name] }
proc ::stub::source {pin} { return [expr {[dict exists $::stub::nets $pin] ? [dict get $::stub::nets $pin] : {}}] }

::stub::command get_bd_pins {} {} 1 1 { return [::stub::place pin [lindex $rest 0]] }
::stub::command get_bd_intf_pins {} {} 1 1 { return [::stub::place interface [lindex $rest 0]] }
::stub::command connect_bd_net {} {} 2 2 {
    lassign $rest from to
    lassign [::stub::pin $from] direction kind
    ::stub::must {$direction eq "out" && [lindex [::stub::pin $to] 0] eq "in"} {$from does not drive $to}
    ::stub::must {$kind eq [lindex [::stub::pin $to] 1]} {$from is of another kind than $to}
    ::stub::must {![dict exists $::stub::nets $to]} {$to is connected twice}
    dict set ::stub::nets $to $from
}
::stub::command connect_bd_intf_net {} {} 2 2 {
    lassign $rest from to
    lassign [::stub::interface $from] side kind
    ::stub::must {$side eq "master" && [lindex [::stub::interface $to] 0] eq "slave"} {$from is not the master of $to}
    ::stub::must {$kind eq [lindex [::stub::interface $to] 1]} {$from is of another kind than $to}
    foreach end $rest {
        ::stub::must {![dict exists $::stub::joins $end]} {$end is connected twice}
    }
    dict set ::stub::joins $from $to
    dict set ::stub::joins $to $from
}
::stub::command get_bd_addr_spaces {} {} 1 1 { return [::stub::object space [lindex $rest 0] {ps7/Data dma/Data_MM2S dma/Data_S2MM}] }
::stub::command get_bd_addr_segs {} {} 1 1 {
    return [::stub::object segment [lindex $rest 0] {core/s_axi/reg0 dma/S_AXI_LITE/Reg ps7/S_AXI_HP0/HP0_DDR_LOWOCM}]
}
::stub::command assign_bd_address {} {offset range target_address_space} 1 1 {
    ::stub::expect space [dict get $options target_address_space]
    ::stub::expect segment [lindex $rest 0]
    lassign [split [::stub::name [lindex $rest 0]] /] cell interface
    ::stub::place interface $cell/$interface
    lappend ::stub::segments [::stub::name [dict get $options target_address_space]] $cell/$interface
}
::stub::command validate_bd_design {} {} 0 0 {
    ::stub::must {[info exists ::stub::external] && $::stub::external eq {FIXED_IO DDR}} {DDR and FIXED_IO are no ports}
    foreach cell [dict keys $::stub::cells] {
        dict for {pin description} [::stub::pins $cell] {
            ::stub::must {[lindex $description 0] eq "out" || [dict exists $::stub::nets pin:$cell/$pin]} {
                input $cell/$pin is not connected}
        }
    }
    foreach cell [dict keys $::stub::cells] {
        dict for {interface description} [::stub::interfaces $cell] {
            lassign $description side kind clock
            ::stub::must {[dict exists $::stub::joins interface:$cell/$interface]} {$cell/$interface is not connected}
            set other [dict get $::stub::joins interface:$cell/$interface]
            set there [lindex [split [::stub::name $other] /] 0]/[lindex [::stub::interface $other] 2]
            ::stub::must {[::stub::source pin:$cell/$clock] eq [::stub::source pin:$there]} {
                the clocks of $cell/$interface and [::stub::name $other] differ}
            if {$side eq "slave" && $kind eq "aximm" && [::stub::ip $cell] ne "smartconnect"} {
                ::stub::must {"$cell/$interface" in $::stub::segments} {$cell/$interface has no address}
            }
        }
    }
    if {"dma" in [dict keys $::stub::cells]} {
        foreach space {dma/Data_MM2S dma/Data_S2MM} {
            ::stub::must {$space in $::stub::segments} {$space has no memory}
        }
    }
    set ::stub::valid 1
}
::stub::command save_bd_design {} {} 0 0 {}

# Implementation

::stub::command make_wrapper {top} {files} 0 0 {
    ::stub::must {[llength [dict get $options files]] == 1 && [info exists ::stub::valid]} {there is no valid design}
    set file [file join $::stub::directory ${::stub::design}_wrapper.v]
    close [open $file w]
    return $file
}
::stub::command get_runs {} {} 1 1 { return [::stub::object run [lindex $rest 0] {synth_1 impl_1}] }
::stub::command launch_runs {} {to_step jobs} 1 1 {
    ::stub::must {[lindex $rest 0] eq "impl_1" && [dict get $options to_step] eq "write_bitstream"} {unknown run or step}
    ::stub::must {[::stub::value fileset:sources_1 top] eq "${::stub::design}_wrapper"} {the wrapper is not the top}
    set run [file join $::stub::directory $::stub::project.runs impl_1]
    set handoff [file join $::stub::directory $::stub::project.gen sources_1 bd $::stub::design hw_handoff]
    file mkdir $run $handoff
    close [open [file join $run ${::stub::design}_wrapper.bit] w]
    close [open [file join $handoff $::stub::design.hwh] w]
}
::stub::command wait_on_run {} {} 1 1 { ::stub::must {[lindex $rest 0] eq "impl_1"} {unknown run} }
::stub::command open_run {} {} 1 1 { ::stub::must {[lindex $rest 0] eq "impl_1"} {unknown run} }
::stub::command report_utilization {hierarchical} {file} 0 0 { close [open [dict get $options file] w] }
::stub::command report_timing_summary {} {file} 0 0 { close [open [dict get $options file] w] }
::stub::command get_timing_paths {setup} {} 0 0 { return path:worst }
::stub::command write_hw_platform {fixed include_bit force} {file} 0 0 { close [open [dict get $options file] w] }

# Constraints

::stub::command get_ports {} {} 1 1 { return [::stub::object port [lindex $rest 0] [dict keys [dict get $::stub::facts pins]]] }
::stub::command create_clock {} {name period} 1 1 {
    ::stub::expect port [lindex $rest 0]
    ::stub::must {[lindex [dict get $::stub::facts pins [::stub::name [lindex $rest 0]]] 1] eq "clock"} {
        [lindex $rest 0] is no clock}
    ::stub::must {[dict get $options period] > 0} {the period must be positive}
}

# The dialogue, and the description of the driver

::stub::command ipgui::add_param {} {name} 1 1 {
    ::stub::must {[dict get $options name] eq "Component_Name"} {the core has no parameter [dict get $options name]}
}
::stub::command ipgui::add_page {} {name} 1 1 {}

::stub::command xdefine_include_file {} {} 5 9 {
    ::stub::must {[lindex $rest 1] eq "xparameters.h" && [lindex $rest 2] eq [dict get $::stub::facts name]} {
        xdefine_include_file $rest is wrong}
}

# ISE: the commands of xtclsh have words, not options, but for -process

::stub::command project {} {process} 1 3 {
    switch [lindex $rest 0] {
        new { ::stub::must {[llength $rest] == 2} {project new takes a file} }
        close {}
        set {
            ::stub::must {[llength $rest] == 3} {project set takes a name and a value}
            lassign $rest _ property value
            set values {family {Spartan6 Virtex5} device {xc6slx45 xc5vlx50t} package {csg324 ff1136} speed {-3 -1} "Add I/O Buffers" {false true}
                "Generate Detailed MAP Report" {false true}}
            dict set values top [dict get $::stub::facts name]
            ::stub::must {[dict exists $values $property] && $value in [dict get $values $property]} {
                project set $property $value is not known}
            dict set ::stub::properties ise $property $value
        }
        default { error "project has no command [lindex $rest 0]" }
    }
}
::stub::command xfile {} {} 2 2 {
    ::stub::must {[lindex $rest 0] eq "add" && [file isfile [lindex $rest 1]]} {there is no file [lindex $rest 1]}
}
::stub::command process {} {} 2 2 {
    ::stub::must {[lindex $rest 0] eq "run" && [lindex $rest 1] eq "Synthesize - XST"} {there is no process $rest}
    foreach property {family device package speed top} { dict get $::stub::properties ise $property }
    return [dict get $::stub::facts synthesised]
}

# Runs the script, and writes the calls at its end.

rename exit ::stub::exit
proc exit {{status 0}} {
    set channel [open $::stub::record w]
    puts $channel [join $::stub::calls \n]
    close $channel
    ::stub::exit $status
}
set argv [lassign $argv ::stub::described ::stub::record argv0]
source $::stub::described
set ::stub::facts $facts
if {[catch {
    source $argv0
    # Scripts that only define what Vivado calls.
    foreach {procedure object} {init_gui core:gui generate driver:software} {
        if {[info commands $procedure] ne {}} { $procedure $object }
    }
} message]} {
    puts stderr $message
    exit 2
}
exit
