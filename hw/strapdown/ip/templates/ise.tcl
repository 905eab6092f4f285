# Synthesises {{ name }} with ISE 14.7, as a part of a larger design:
#
#   xtclsh ise.tcl ?FAMILY DEVICE PACKAGE SPEED?
#
# The part is {{ ise_part | join(' ') }} unless given. The results are in build/ise.

set name {{ name }}
set here [file normalize [file dirname [info script]]]
set part {{ '{' }}{{ ise_part | join(' ') }}}
if {[llength $argv] == 4} {
    set part $argv
} elseif {[llength $argv] != 0} {
    puts stderr "ise.tcl: name a part by family, device, package and speed, as in: xtclsh ise.tcl $part"
    exit 1
}

set folder [file join $here build ise]
file mkdir $folder
cd $folder
if {[file exists $name.xise]} {
    file delete $name.xise
}
project new $name.xise
project set family [lindex $part 0]
project set device [lindex $part 1]
project set package [lindex $part 2]
project set speed [lindex $part 3]
xfile add [file join $here {{ places.verilog }}]
project set top $name
# The ports of the core are no pins.
project set "Add I/O Buffers" "false" -process "Synthesize - XST"
if {![process run "Synthesize - XST"]} {
    puts stderr "ise.tcl: the synthesis failed: see [file join $folder $name.syr]"
    exit 1
}
project close
puts "Synthesised $name: see [file join $folder $name.syr]"
