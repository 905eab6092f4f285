// Self-checking bench of {{ name }}, configuration {{ configuration }}: plain Verilog-2001. In the folder of the package:
//
//   iverilog -g2001 -o tb {{ places.verilog }} {{ places.bench }} && vvp -N tb
//
// It carries out the steps of {{ places.vectors }}, which were computed by the software twin, and prints PASS, or the
// first difference with its update and register, after which it stops by $stop: vvp -N then has the exit status 1.
// +vectors=FILE names another file of steps.
module {{ name }}_tb;
  localparam STEPS = {{ count }};
  // Cycles after which an answer of the bus is missing.
  localparam LIMIT = {{ limit }};

  reg aclk = 1'b0;
  reg aresetn = 1'b0;
  always #5 aclk = ~aclk;

{% for port in inputs %}
  reg {{ port.range }}{{ port.name }} = 0;
{% endfor %}
{% for port in outputs %}
  wire {{ port.range }}{{ port.name }};
{% endfor %}

  {{ name }} dut (
{% for port in ports %}
    .{{ port.name }}({{ port.name }}){{ ',' if not loop.last }}
{% endfor %}
  );

  // A step: operation, address, data, mask.
  reg [87:0] steps [0:STEPS-1];
  reg [8*256-1:0] vectors;
  reg [7:0] operation;
  reg [15:0] address;
  reg [31:0] data, mask, got;
  reg [1:0] answer;
  integer step, update, waited;
  reg pending, failed;

  // Transfers at the last clock edge, and what they carried. Inputs of the core change at falling edges.
  reg aw_done, w_done, b_done, ar_done, r_done;
  always @(posedge aclk) begin
    aw_done <= s_axi_awvalid & s_axi_awready;
    w_done <= s_axi_wvalid & s_axi_wready;
    b_done <= s_axi_bvalid & s_axi_bready;
    ar_done <= s_axi_arvalid & s_axi_arready;
    r_done <= s_axi_rvalid & s_axi_rready;
    if (s_axi_bvalid & s_axi_bready) answer <= s_axi_bresp;
    if (s_axi_rvalid & s_axi_rready) begin
      answer <= s_axi_rresp;
      got <= s_axi_rdata;
    end
  end
{% if streams %}
  reg sent, taken, last;
{% if channel_bits %}
  reg [{{ channel_bits - 1 }}:0] channel;
{% endif %}
  always @(posedge aclk) begin
    sent <= s_axis_tvalid & s_axis_tready;
    taken <= m_axis_tvalid & m_axis_tready;
    if (m_axis_tvalid & m_axis_tready) begin
      got <= m_axis_tdata;
      last <= m_axis_tlast;
{% if channel_bits %}
      channel <= m_axis_tid;
{% endif %}
    end
  end
{% endif %}

  // Name of the register at an address.
  reg [8*{{ longest }}-1:0] register;
  task find_register;
    case (address)
{% for item in registers %}
      16'h{{ '%04x' % item.address }}: register = "{{ item.name }}";
{% endfor %}
      default: register = "no register";
    endcase
  endtask

  task fail;
    begin
      find_register;
      $display("FAIL: update %0d, %0s (address %h): %h instead of %h, answer %0d", update, register, address, got & mask,
               data & mask, answer);
      failed = 1'b1;
    end
  endtask

  // Counts a cycle of waiting, which fails if there were too many.
  task cycle;
    input [31:0] most;
    begin
      @(negedge aclk);
      waited = waited + 1;
      if (waited > most) begin
        find_register;
        $display("FAIL: update %0d, %0s (address %h): no answer in %0d cycles", update, register, address, most);
        failed = 1'b1;
      end
    end
  endtask

  task write;
    begin
      s_axi_awaddr = address[11:0];
      s_axi_wdata = data;
      s_axi_wstrb = 4'b1111;
      s_axi_awvalid = 1'b1;
      s_axi_wvalid = 1'b1;
      s_axi_bready = 1'b1;
      waited = 0;
      pending = 1'b1;
      while (pending && !failed) begin
        cycle(LIMIT);
        if (b_done) pending = 1'b0;
        if (aw_done) s_axi_awvalid = 1'b0;
        if (w_done) s_axi_wvalid = 1'b0;
      end
      s_axi_bready = 1'b0;
    end
  endtask

  task read;
    begin
      s_axi_araddr = address[11:0];
      s_axi_arvalid = 1'b1;
      s_axi_rready = 1'b1;
      waited = 0;
      pending = 1'b1;
      while (pending && !failed) begin
        cycle(LIMIT);
        if (r_done) pending = 1'b0;
        if (ar_done) s_axi_arvalid = 1'b0;
      end
      s_axi_rready = 1'b0;
    end
  endtask
{% if streams %}

  task send;
    begin
      s_axis_tdata = data;
      s_axis_tlast = mask[0];
{% if channel_bits %}
      s_axis_tid = mask[{{ channel_bits }}:1];
{% endif %}
      s_axis_tvalid = 1'b1;
      waited = 0;
      pending = 1'b1;
      while (pending && !failed) begin
        cycle(LIMIT);
        if (sent) pending = 1'b0;
      end
      s_axis_tvalid = 1'b0;
    end
  endtask

  task take;
    begin
      m_axis_tready = 1'b1;
      waited = 0;
      pending = 1'b1;
      while (pending && !failed) begin
        cycle(LIMIT);
        if (taken) pending = 1'b0;
      end
      m_axis_tready = 1'b0;
      if (!failed && (last !== mask[0]{{ ' || channel !== mask[%d:1]' % channel_bits if channel_bits }})) begin
        find_register;
        $display("FAIL: update %0d, %0s (address %h): wrong TLAST{{ ' or TID' if channel_bits }}", update, register, address);
        failed = 1'b1;
      end
    end
  endtask
{% endif %}

  initial begin
    if (!$value$plusargs("vectors=%s", vectors)) vectors = "{{ places.vectors }}";
    $readmemh(vectors, steps);
    update = 0;
    failed = 1'b0;
    address = 16'd0;
    repeat (4) @(negedge aclk);
    aresetn = 1'b1;
    step = 0;
    {operation, address, data, mask} = steps[0];
    while (operation != 8'd{{ op.END }} && !failed) begin
      case (operation)
        8'd{{ op.UPDATE }}: update = data;
        8'd{{ op.WRITE }}: begin
          write;
          if (!failed && answer !== mask[1:0]) fail;
        end
        8'd{{ op.READ }}: begin
          read;
          if (!failed && (answer !== 2'd0 || (got & mask) !== (data & mask))) fail;
        end
        8'd{{ op.READ_ANSWER }}: begin
          read;
          if (!failed && answer !== mask[1:0]) fail;
        end
        8'd{{ op.INTERRUPT }}: begin
          waited = 0;
          while (irq !== 1'b1 && !failed) cycle(data);
        end
        8'd{{ op.IDLE }}: repeat (data) @(negedge aclk);
        8'd{{ op.RESET }}: begin
          aresetn = 1'b0;
          repeat (data) @(negedge aclk);
          aresetn = 1'b1;
        end
{% if streams %}
        8'd{{ op.SEND }}: send;
        8'd{{ op.TAKE }}: begin
          take;
          mask = 32'hffffffff;
          if (!failed && got !== data) fail;
        end
{% endif %}
        default: begin
          $display("FAIL: step %0d has no operation %0d", step, operation);
          failed = 1'b1;
        end
      endcase
      step = step + 1;
      {operation, address, data, mask} = steps[step];
    end
    if (!failed && update != {{ updates }}) begin
      $display("FAIL: %0s has no steps", vectors);
      failed = 1'b1;
    end
    if (failed) $stop;
    else begin
      $display("PASS: %0d updates equal the software twin in every bit", update);
      $finish;
    end
  end
endmodule
