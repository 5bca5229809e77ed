"""Files of controls, written by hand, and what is read from them."""

from __future__ import annotations

from feedsim.files.control.reading import Reading

NC = """; start-up data, written by hand
%_N_INITIAL_INI
;$PATH=/_N_INI_DIR
CHANDATA(1)
N10000 $MN_AXCONF_MACHAX_NAME_TAB[0]="X1"
N10000 $MN_AXCONF_MACHAX_NAME_TAB[1]="Y1" ; the second one
N10240 $MN_SCALING_SYSTEM_IS_METRIC=1
N20050 $MC_AXCONF_GEOAX_ASSIGN_TAB[0]=1
CHANDATA(2)
N30300 $MA_IS_ROT_AX[AX1]=FALSE
N31030 $MA_LEADSCREW_PITCH[AX1]=10
N31050 $MA_DRIVE_AX_RATIO_DENOM[0,AX1]=1
N31060 $MA_DRIVE_AX_RATIO_NUMERA[0,AX1]=2
N32200 $MA_POSCTRL_GAIN[0,AX1]=5
N32200 $MA_POSCTRL_GAIN[1,AX1]=2.5
N32200 $MA_POSCTRL_GAIN[0,AX2]=.15EX1 '2C3D
   $MA_VELO_FFW_WEIGHT[0,AX1] = 0.95 ; without a number
N32620 $MA_FFW_MODE[AX1]=3
N32620 $MA_FFW_MODE[AX2]=0
N32610 $MA_VELO_FFW_WEIGHT[0,AX2]=1
N32810 $MA_EQUIV_SPEEDCTRL_TIME[0,AX1]=0.0035
N32900 $MA_DYN_MATCH_ENABLE[AX1]=1
N32910 $MA_DYN_MATCH_TIME[0,AX1]=1.2E-3
N32300 $MA_MAX_AX_ACCEL[0,AX1]=2.5
N32450 $MA_BACKLASH[0,AX1]=0.012
M17
"""
DRIVE = """[SINUMERIK_HEADER]
VERSION=1
[SINAMICS_HEADER]
PD_FILE_NAME=PS000003.TEA
[PARAMETER]
p115[0]=125
p115[1]=125
p1400[0]='H8029'
p1433[0]=120
p1434[0]=1.25
p1460[0]=7.5
p1460[1]=9
p1462[0]=12.5
p1520[0]=80
p1521[0]=-80
p1656[0]='H0003'
p1657[0]=2
p1658[0]=455
p1659[0]=0.9
p1660[0]=455
p1661[0]=0.1
p1662[0]=1
p1663[0]=1999
p1664[0]=0.7
p1665[0]=2000
p1666[0]=0.7
p316[0]=1.6
p314[0]=4
r2=31
"""
TABLE = """Parameter;Name;Value;Unit
p1460[0];Speed controller P gain;7.5;Nms/rad
p1462[0];Speed controller integral time;12,5;ms
p1520[0];Torque limit;80000;mNm
"p1715[0]";"Current controller; P gain";"10.4";"V/A"
S-0-0100;nothing
"""
INI = """[EMC]
MACHINE = mill
[EMCMOT]
SERVO_PERIOD = 1000000
[TRAJ]
COORDINATES = X Z
LINEAR_UNITS = inch
[JOINT_0]
TYPE = LINEAR
MAX_VELOCITY = 10 # inch/s
MAX_ACCELERATION = 100
MIN_LIMIT = 0
MAX_LIMIT = 20
BACKLASH = 0.001
P = 50
[JOINT_1]
UNITS = mm
MAX_VELOCITY = 200
BACKLASH = 0.02
COMP_FILE = z.comp
"""


def values(found: Reading, axis: str) -> dict[str, object]:
    return {each.parameter: each.value for each in found.taken if each.axis == axis}


def reasons(found: Reading) -> dict[str, str]:
    return {each.name.number: each.reason for each in found.refused if each.weight == "doubt"}
