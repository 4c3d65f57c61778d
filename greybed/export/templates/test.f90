! Test of {{ name }}.f90: says the hash, then answers rows of markers from stdin, count first.
! SPDX-License-Identifier: {{ facts.licence }}
program {{ name }}_test
  use {{ name }}
  implicit none
  type(c_ptr) :: library
  character(len=400) :: message
  real(c_double) :: markers(n_markers), outputs(n_outputs), graded(n_answers)
  real(c_double) :: gradient(n_markers, n_answers)
  real(c_double), allocatable :: rows(:, :), answers(:, :)
  integer :: n, k, failed
  integer(c_int) :: extrapolates, status

  library = open_library(message)
  if (.not. c_associated(library)) then
    print '(a)', trim(message)
    stop 1
  end if
  print '(a)', hash()
  read *, n
  allocate (rows(n_markers, n), answers(n_answers, n))
  do k = 1, n
    read *, rows(:, k)
  end do
  failed = eval_batch(library, int(n, c_size_t), rows, answers)
  do k = 1, n
    markers = rows(:, k)
    status = predict(library, markers, outputs, extrapolates)
    failed = failed + status + eval_grad(library, markers, graded, gradient)
    print '(*(es25.17e3, 1x))', outputs, answers(:, k), gradient, real(extrapolates, c_double)
  end do
  if (failed /= 0) stop 1
end program {{ name }}_test
