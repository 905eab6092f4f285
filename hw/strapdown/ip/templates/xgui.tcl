# Dialogue of {{ vlnv }} in Vivado: the core has no parameters but the name of its instance.

proc init_gui { IPINST } {
  ipgui::add_param $IPINST -name "Component_Name"
  ipgui::add_page $IPINST -name "Page 0"
}
