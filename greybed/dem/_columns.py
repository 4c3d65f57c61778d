"""Numbers of laws, and what stands in which column: material pairs, histories, batches."""

# Normal laws, rolling resistance and cohesion; 0 is none where there may be none.
LINEAR, HERTZ, HYSTERESIS, VISCOELASTIC = 0, 1, 2, 3
NO_ROLLING, CONSTANT_TORQUE, EPSD, EPSD_MODIFIED, VISCOUS = 0, 1, 2, 3, 4
NO_COHESION, SJKR, DMT, VAN_DER_WAALS, JKR, LIQUID = 0, 1, 2, 3, 4, 5

# Columns of the table of material pairs.
MODULUS = 0  # E* [Pa]; stiffness [N/m] for linear laws
SHEAR = 1  # G* [Pa]; tangential stiffness [N/m] for linear laws
DAMPING = 2  # share of critical damping, in the units of each law [-]
TANGENTIAL_DAMPING = 3  # for tangential motion; over the normal root for laws from moduli [-]
FRICTION = 4  # static friction [-]
SLIDING = 5  # dynamic friction [-]
ROLLING = 6  # rolling friction [-]; time of viscous rolling [s]
ROLLING_DAMPING = 7  # share of critical rolling damping [-]
COHESION = 8  # energy density [J/m3], surface energy [J/m2], Hamaker constant [J] or tension [N/m]
UNLOADING = 9  # unloading over loading stiffness (hysteresis) [-]; relaxation (viscoelastic) [s]
COLUMNS = 12
NEAREST = 10  # gap below which van der Waals forces no longer grow [m]; volume of a bridge [m3]
REACH = 11  # gap beyond which cohesion ends [m]

# Columns of the history of a contact.
SPRING, TWIST, PLASTIC = 0, 3, 6

# What a contact is: none, surfaces that touch, or a bridge of liquid across a gap.
APART, TOUCH, BRIDGE = 0, 1, 2

# Contacts of a batch: its rows stay in the nearest cache.
SIZE = 96
# Rows of a batch: the columns of the table, then one number of each contact [SI]. The first body
# feels the force, N points to it from the second, U is its velocity relative to the second without
# spin, V that of the surfaces in contact, along them; I and J are the spins of the two, UN is U
# along N. FORCE is along N, K_N and K_T are stiffnesses and DASHPOT [N s/m] is the tangential one.
# S is the tangential spring, T that of rolling, DEEP the plastic overlap. F is the whole force, B
# is N x its tangential part, R the rolling torque.
LAW_MODULUS, LAW_SHEAR, LAW_DAMPING, LAW_TANGENTIAL, LAW_FRICTION, LAW_SLIDING = range(6)
LAW_ROLLING, LAW_ROLLING_DAMPING, LAW_COHESION, LAW_UNLOADING, LAW_NEAREST = range(6, 11)
NX, NY, NZ, OVERLAP, R_EFF, M_EFF, INERTIA, ARM_I, ARM_J, AREA = range(12, 22)
UX, UY, UZ, IX, IY, IZ, JX, JY, JZ = range(22, 31)
UN, VX, VY, VZ, FORCE, K_N, K_T, DASHPOT = range(31, 39)
SX, SY, SZ, TX, TY, TZ, DEEP = range(39, 46)
FX, FY, FZ, BX, BY, BZ, RX, RY, RZ = range(46, 55)
RI, RJ, MI, MJ = range(55, 59)
HELD = 59  # what presses the surfaces together besides the normal force [N]; 0 but for JKR
ROWS = 60
