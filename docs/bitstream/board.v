// The optical attitude sensor on an OrangeCrab r0.2: two TCD1304, two serial ADCs, and a serial line.
module board (
    input  wire clk48,          // 48 MHz oscillator
    output wire ccd_clk, ccd_sh_r, ccd_sh_p, ccd_icg,
    output wire adc_cs_n, adc_sclk,
    input  wire adc_sdata_r, adc_sdata_p,
    output wire uart_tx);

    // The constants of the unit, from calibration.json of `strapdown calibrate optical`, as binary32.
    OPT_top sensor (
        .clk(clk48), .rst_n(1'b1), .in_run_en(1'b1),
        .in_acc_en(1'b0), .in_accx(32'h0), .in_accy(32'h0), .in_accz(32'h0), .in_yaw_rate(32'h0),
        .in_n0_r(32'h44e40000), .in_n0_p(32'h44e40000), .in_scale_r(32'h3951b717), .in_scale_p(32'h3951b717),
        .in_tilt_r(32'h0), .in_tilt_p(32'h0), .in_c3_r(32'h0), .in_c3_p(32'h0), .in_h(32'h0), .in_k(32'h0),
        .ccd_clk(ccd_clk), .ccd_sh_r(ccd_sh_r), .ccd_sh_p(ccd_sh_p), .ccd_icg(ccd_icg),
        .adc_cs_n(adc_cs_n), .adc_sclk(adc_sclk), .adc_sdata_r(adc_sdata_r), .adc_sdata_p(adc_sdata_p),
        .out_middle(), .out_attitude_finish(), .out_roll(), .out_pitch(), .out_roll_measured(),
        .out_pitch_measured(), .out_status(), .out_line(), .out_link_busy(), .out_link_overrun(),
        .uart_tx(uart_tx));
endmodule
