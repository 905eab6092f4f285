// A slave with one register, and an answer stream that repeats it. The register is a fault of the slave against AXI:
// 0 none, 1 an answer to a write goes away, 2 an answer to a read goes away, 3 data of a read change, 4 an answer to no
// write, 5 an answer to no read, 6 no answer, 7 ready depends on valid, 8 EXOKAY, 9 words of the stream change,
// 10 offers during a reset.
module faulty_slave (
    input aclk, input aresetn,
    input [11:0] s_axi_awaddr, input s_axi_awvalid, output s_axi_awready,
    input [31:0] s_axi_wdata, input [3:0] s_axi_wstrb, input s_axi_wvalid, output s_axi_wready,
    output [1:0] s_axi_bresp, output reg s_axi_bvalid, input s_axi_bready,
    input [11:0] s_axi_araddr, input s_axi_arvalid, output s_axi_arready,
    output reg [31:0] s_axi_rdata, output [1:0] s_axi_rresp, output reg s_axi_rvalid, input s_axi_rready,
    input [31:0] s_axis_tdata, input s_axis_tlast, input s_axis_tvalid, output s_axis_tready,
    output reg [31:0] m_axis_tdata, output m_axis_tlast, output reg m_axis_tvalid, input m_axis_tready,
    output irq
);
    reg [31:0] fault = 0;
    reg address = 0, data = 0;
    assign s_axi_awready = ~address & ~s_axi_bvalid, s_axi_wready = ~data & ~s_axi_bvalid;
    assign s_axi_arready = ~s_axi_rvalid & (fault != 7 | s_axi_arvalid);
    assign s_axi_bresp = 0, s_axi_rresp = fault == 8, s_axis_tready = 0, m_axis_tlast = 0, irq = 0;
    always @(posedge aclk) begin
        if (s_axi_awvalid & s_axi_awready) address <= 1;
        if (s_axi_wvalid & s_axi_wready) begin
            data <= 1;
            fault <= s_axi_wdata;
        end
        if (address & data & ~s_axi_bvalid) s_axi_bvalid <= 1;
        if (s_axi_bvalid & (s_axi_bready | fault == 1)) begin
            s_axi_bvalid <= 0;
            address <= 0;
            data <= 0;
        end
        if (fault == 4) s_axi_bvalid <= 1;
        if (s_axi_arvalid & s_axi_arready & fault != 6 | fault == 5) begin
            s_axi_rvalid <= 1;
            s_axi_rdata <= fault;
        end
        if (s_axi_rvalid & ~s_axi_rready & fault == 3) s_axi_rdata <= ~s_axi_rdata;
        if (s_axi_rvalid & (s_axi_rready | fault == 2)) s_axi_rvalid <= 0;
        m_axis_tvalid <= 1;
        if (~m_axis_tvalid | m_axis_tready | fault == 9) m_axis_tdata <= m_axis_tdata + 1;
        if (~aresetn) begin
            s_axi_bvalid <= 0;
            address <= 0;
            data <= 0;
            s_axi_rvalid <= 0;
            m_axis_tvalid <= fault == 10;
            fault <= fault == 10 ? 10 : 0;
        end
    end
endmodule
