// All modules, instantiated with the ports in the text of the thesis.
module user(input clk, input reset_n, input start, input [511:0] data, output [7:0] finish,
            output [1311:0] results);
  wire [7:0] now;
  reg [7:0] before = 0;
  always @(posedge clk) before <= now;
  assign finish = now & ~before;
  wire [31:0] exa, eya, eza, exm, eym, ezm, exi, eyi, ezi, wx, wy, wz, q0, q1, q2, q3;
  wire [31:0] c11, c12, c13, c21, c22, c23, c31, c32, c33, pitch, roll, yaw, angle;
  wire [383:0] top;
  assign results = {exa, eya, eza, exm, eym, ezm, exi, eyi, ezi, wx, wy, wz, q0, q1, q2, q3,
                    c11, c12, c13, c21, c22, c23, c31, c32, c33, pitch, roll, yaw, angle, top};

  INS_acc acc(.clk(clk), .rst_n(reset_n), .in_acc_en(start), .in_accx(data[31:0]), .in_accy(data[63:32]),
    .in_accz(data[95:64]), .in_c13(data[127:96]), .in_c23(data[159:128]), .in_c33(data[191:160]), .out_exa(exa),
    .out_eya(eya), .out_eza(eza), .out_acc_finish(now[0]));
  INS_mag mag(.clk(clk), .rst_n(reset_n), .in_mag_en(start), .in_magx(data[31:0]), .in_magy(data[63:32]),
    .in_magz(data[95:64]), .in_c11(data[127:96]), .in_c12(data[159:128]), .in_c13(data[191:160]),
    .in_c21(data[223:192]), .in_c22(data[255:224]), .in_c23(data[287:256]), .in_c31(data[319:288]),
    .in_c32(data[351:320]), .in_c33(data[383:352]), .out_exm(exm), .out_eym(eym), .out_ezm(ezm),
    .out_mag_finish(now[1]));
  INS_gyro gyro(.clk(clk), .rst_n(reset_n), .in_gyro_en(finish[0]), .in_gyrox(data[31:0]),
    .in_gyroy(data[63:32]), .in_gyroz(data[95:64]), .in_exa(exa), .in_eya(eya), .in_eza(eza), .in_exm(exm),
    .in_eym(eym), .in_ezm(ezm), .in_exi(data[127:96]), .in_eyi(data[159:128]), .in_ezi(data[191:160]),
    .out_exi(exi), .out_eyi(eyi), .out_ezi(ezi), .out_wx(wx), .out_wy(wy), .out_wz(wz), .out_gyro_finish(now[2]));
  INS_quat quat(.clk(clk), .rst_n(reset_n), .in_quat_en(finish[2]), .in_q0(data[31:0]), .in_q1(data[63:32]),
    .in_q2(data[95:64]), .in_q3(data[127:96]), .in_wx(wx), .in_wy(wy), .in_wz(wz), .out_q0(q0), .out_q1(q1),
    .out_q2(q2), .out_q3(q3), .out_quat_finish(now[3]));
  INS_matx matx(.clk(clk), .rst_n(reset_n), .in_matx_en(finish[3]), .in_q0(q0), .in_q1(q1), .in_q2(q2), .in_q3(q3),
    .out_c11(c11), .out_c12(c12), .out_c13(c13), .out_c21(c21), .out_c22(c22), .out_c23(c23), .out_c31(c31),
    .out_c32(c32), .out_c33(c33), .out_matx_finish(now[4]));
  INS_euler euler(.clk(clk), .rst_n(reset_n), .in_euler_en(finish[4]), .in_c11(c11), .in_c12(c12), .in_c13(c13),
    .in_c23(c23), .in_c33(c33), .out_pitch(pitch), .out_roll(roll), .out_yaw(yaw), .out_euler_finish(now[5]));
  INS_atan atan_1(.clk(clk), .rst_n(reset_n), .in_atan_en(finish[4]), .in_a(c33), .in_b(c23), .out_result(angle),
    .out_atan_finish(now[6]));
  INS_top ins(.clk(clk), .rst_n(reset_n), .in_data_en(start), .in_accx(data[31:0]), .in_accy(data[63:32]),
    .in_accz(data[95:64]), .in_magx(data[127:96]), .in_magy(data[159:128]), .in_magz(data[191:160]),
    .in_gyrox(data[223:192]), .in_gyroy(data[255:224]), .in_gyroz(data[287:256]), .out_c11(top[383:352]),
    .out_c12(top[351:320]), .out_c13(top[319:288]), .out_c21(top[287:256]), .out_c22(top[255:224]),
    .out_c23(top[223:192]), .out_c31(top[191:160]), .out_c32(top[159:128]), .out_c33(top[127:96]),
    .out_pitch(top[95:64]), .out_roll(top[63:32]), .out_yaw(top[31:0]), .out_INS_finish(now[7]));
endmodule
