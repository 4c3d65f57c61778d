! {{ name }}: {{ quantity.title }}. Fortran interface of lib{{ name }}.so.
! Written by greybed {{ facts.greybed_version }}; hash
! {{ facts.hash }}.
! SPDX-License-Identifier: {{ facts.licence }}
!
! Open it once; a build whose golden rows fail gives a null pointer and a message. Markers, answers
! and physical numbers stand in the order that {{ name }}_c.h tells, all of them in SI or [{{ unit }}].
module {{ name }}
  use, intrinsic :: iso_c_binding
  implicit none
  public

  integer(c_int), parameter :: abi_version = 1
  integer, parameter :: n_markers = {{ markers|length }}, n_answers = {{ n_answers }}, n_outputs = {{ outputs|length }}, &
    n_inputs = {{ flat|length }}
  integer(c_int64_t), parameter :: policy_clamp = 0, policy_baseline = 1, policy_abort = 2, &
    policy_extrapolate = 3
  integer(c_int), parameter :: status_inside = 0, status_clamped = 1, status_baseline = 2, &
    status_refused = 3, status_extrapolated = 4, not_open = -1

  ! Policy and counts; the host owns it, one for each thread.
  type, bind(c) :: guard
    integer(c_int64_t) :: policy = policy_baseline
    integer(c_int64_t) :: calls = 0
    integer(c_int64_t) :: outside = 0
    integer(c_int64_t) :: invalid = 0
  end type guard
{% if with_material %}

  ! Particles in a gas under gravity: make it once.
  type, bind(c) :: material
    real(c_double) :: numbers({{ n_material }}) = 0.0_c_double
  end type material
{% endif %}

  interface
    function c_open(abi, message, size) bind(c, name="{{ name }}_open") result(library)
      import :: c_ptr, c_int, c_char, c_size_t
      integer(c_int), value :: abi
      character(kind=c_char), intent(out) :: message(*)
      integer(c_size_t), value :: size
      type(c_ptr) :: library
    end function c_open

    function c_hash() bind(c, name="{{ name }}_hash") result(text)
      import :: c_ptr
      type(c_ptr) :: text
    end function c_hash

    function eval(library, markers, answers) bind(c, name="{{ name }}_eval") result(status)
      import :: c_ptr, c_double, c_int
      type(c_ptr), value :: library
      real(c_double), intent(in) :: markers({{ markers|length }})
      real(c_double), intent(out) :: answers({{ n_answers }})
      integer(c_int) :: status
    end function eval

    ! gradient(i, k) is the derivative of answer k for marker i.
    function eval_grad(library, markers, answers, gradient) &
        bind(c, name="{{ name }}_eval_grad") result(status)
      import :: c_ptr, c_double, c_int
      type(c_ptr), value :: library
      real(c_double), intent(in) :: markers({{ markers|length }})
      real(c_double), intent(out) :: answers({{ n_answers }}), gradient({{ markers|length }}, {{ n_answers }})
      integer(c_int) :: status
    end function eval_grad

    function eval_batch(library, n, markers, answers) &
        bind(c, name="{{ name }}_eval_batch") result(status)
      import :: c_ptr, c_double, c_int, c_size_t
      type(c_ptr), value :: library
      integer(c_size_t), value :: n
      real(c_double), intent(in) :: markers({{ markers|length }}, n)
      real(c_double), intent(out) :: answers({{ n_answers }}, n)
      integer(c_int) :: status
    end function eval_batch

    function predict(library, markers, outputs, extrapolates) &
        bind(c, name="{{ name }}_predict") result(status)
      import :: c_ptr, c_double, c_int
      type(c_ptr), value :: library
      real(c_double), intent(in) :: markers({{ markers|length }})
      real(c_double), intent(out) :: outputs({{ outputs|length }})
      integer(c_int), intent(out) :: extrapolates
      integer(c_int) :: status
    end function predict

    function in_domain(library, markers) bind(c, name="{{ name }}_in_domain") result(inside)
      import :: c_ptr, c_double, c_int
      type(c_ptr), value :: library
      real(c_double), intent(in) :: markers({{ markers|length }})
      integer(c_int) :: inside
    end function in_domain
{% if with_material %}

    function make_material(library, diameter, particle_density, gas_density, gas_viscosity, &
        gravity, made) bind(c, name="{{ name }}_make_material") result(status)
      import :: c_ptr, c_double, c_int, material
      type(c_ptr), value :: library
      real(c_double), value :: diameter, particle_density, gas_density, gas_viscosity
      real(c_double), intent(in) :: gravity(3)
      type(material), intent(out) :: made
      integer(c_int) :: status
    end function make_material

    ! derivative(j, i) = dF_i / dslip_j.
    function force(library, made, inputs, guarded, forces, derivative, exchange) &
        bind(c, name="{{ name }}_force") result(status)
      import :: c_ptr, c_double, c_int, material, guard
      type(c_ptr), value :: library
      type(material), intent(in) :: made
      real(c_double), intent(in) :: inputs({{ flat|length }})
      type(guard), intent(inout) :: guarded
      real(c_double), intent(out) :: forces(3), derivative(3, 3), exchange
      integer(c_int) :: status
    end function force
{% else %}

    function physical(library, inputs, guarded, answer, gradient) &
        bind(c, name="{{ name }}_physical") result(status)
      import :: c_ptr, c_double, c_int, guard
      type(c_ptr), value :: library
      real(c_double), intent(in) :: inputs({{ flat|length }})
      type(guard), intent(inout) :: guarded
      real(c_double), intent(out) :: answer, gradient({{ flat|length }})
      integer(c_int) :: status
    end function physical
{% endif %}
  end interface

contains

  ! A null pointer, and a message, where golden rows fail.
  function open_library(message) result(library)
    character(len=*), intent(out) :: message
    type(c_ptr) :: library
    character(kind=c_char) :: text(512)
    integer :: k
    library = c_open(abi_version, text, 512_c_size_t)
    message = ""
    do k = 1, min(len(message), 512)
      if (text(k) == c_null_char) exit
      message(k:k) = text(k)
    end do
  end function open_library

  ! SHA-256 of what the closure answers; the same in every exported form.
  function hash() result(text)
    character(len=64) :: text
    character(kind=c_char), pointer :: letters(:)
    integer :: k
    call c_f_pointer(c_hash(), letters, [64])
    do k = 1, 64
      text(k:k) = letters(k)
    end do
  end function hash

end module {{ name }}
