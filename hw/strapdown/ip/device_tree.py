"""The device-tree node of a core on a Zynq, for Linux and its driver ``uio_pdrv_genirq``."""

from strapdown.bus import TABLE_SIZE, RegisterTable

__all__ = ["text"]


def text(table: RegisterTable, address: int) -> str:
    """The file NAME.dtsi of a table NAME: a node below ``amba``, for a core at an address with its irq at IRQ_F2P."""
    return f"""\
/* {table.name}, configuration {table.configuration}, at {address:#x}, its irq at IRQ_F2P[0] of a Zynq-7000.
 *
 * Include it in the tree of a board, or put the lines "/dts-v1/;" and "/plugin/;" before it for an overlay. The kernel
 * needs the driver uio_pdrv_genirq, with uio_pdrv_genirq.of_id=generic-uio on its command line.
 */
&amba {{
    {table.name.lower()}: navigation@{address:x} {{
        compatible = "generic-uio";
        reg = <{address:#x} {TABLE_SIZE:#x}>;
        interrupt-parent = <&intc>;
        interrupts = <0 29 4>; /* shared peripheral interrupt 61, active at a high level */
    }};
}};
"""
