{# Layers of a network with all sums in registers, whatever the compiler makes of loops. #}
/// B blocks of four sums, two at a time.
template <int B>
struct Sums {
  v8 head;
  Sums<B - 2> rest;

  GREYBED_HOT void set(double x) {
    spread(x, head);
    rest.set(x);
  }
  GREYBED_HOT void get(const double* p) {
    load(p, head);
    rest.get(p + 8);
  }
  GREYBED_HOT void put(double* p) const {
    store(head, p);
    rest.put(p + 8);
  }
  /// += p x
  GREYBED_HOT void add(const double* p, const v8& x) {
    v8 w;
    load(p, w);
    add_product(head, w, x);
    rest.add(p + 8, x);
  }
  GREYBED_HOT void join(const Sums& other) {
    head = head + other.head;
    rest.join(other.rest);
  }
  GREYBED_HOT void scale_by(const double* p) {
    v8 w;
    load(p, w);
    head = head * w;
    rest.scale_by(p + 8);
  }
  /// = s x + t y
  GREYBED_HOT void mix(const Sums& x, const v8& s, const Sums& y, const v8& t) {
    head = x.head * s + y.head * t;
    rest.mix(x.rest, s, y.rest, t);
  }
  /// = s x
  GREYBED_HOT void scaled(const Sums& x, const v8& s) {
    head = x.head * s;
    rest.scaled(x.rest, s);
  }
  /// Dot product with p.
  GREYBED_HOT double dot(const double* p) const {
    v8 w;
    load(p, w);
    v8 sum = head * w;
    rest.onto(p + 8, sum);
    return total(sum) + rest.last(p + 8);
  }
  /// The products of whole pairs of blocks onto a sum, and the odd block alone.
  GREYBED_HOT void onto(const double* p, v8& sum) const {
    v8 w;
    load(p, w);
    add_product(sum, head, w);
    rest.onto(p + 8, sum);
  }
  GREYBED_HOT double last(const double* p) const { return rest.last(p + 8); }
};
template <>
struct Sums<0> {
  GREYBED_HOT void set(double) {}
  GREYBED_HOT void get(const double*) {}
  GREYBED_HOT void put(double*) const {}
  GREYBED_HOT void add(const double*, const v8&) {}
  GREYBED_HOT void join(const Sums&) {}
  GREYBED_HOT void scale_by(const double*) {}
  GREYBED_HOT void mix(const Sums&, const v8&, const Sums&, const v8&) {}
  GREYBED_HOT void scaled(const Sums&, const v8&) {}
  GREYBED_HOT void onto(const double*, v8&) const {}
  GREYBED_HOT double last(const double*) const { return 0.0; }
};
/// One block: the end of a row of an odd number of blocks.
template <>
struct Sums<1> {
  v4 head;

  GREYBED_HOT void set(double x) { spread(x, head); }
  GREYBED_HOT void get(const double* p) { load(p, head); }
  GREYBED_HOT void put(double* p) const { store(head, p); }
  GREYBED_HOT void add(const double* p, const v8& x) {
    v4 w;
    load(p, w);
    add_product(head, w, half(x));
  }
  GREYBED_HOT void join(const Sums& other) { head = head + other.head; }
  GREYBED_HOT void scale_by(const double* p) {
    v4 w;
    load(p, w);
    head = head * w;
  }
  GREYBED_HOT void mix(const Sums& x, const v8& s, const Sums& y, const v8& t) {
    head = x.head * half(s) + y.head * half(t);
  }
  GREYBED_HOT void scaled(const Sums& x, const v8& s) { head = x.head * half(s); }
  GREYBED_HOT double dot(const double* p) const { return last(p); }
  GREYBED_HOT void onto(const double*, v8&) const {}
  GREYBED_HOT double last(const double* p) const {
    v4 w;
    load(p, w);
    return total(head * w);
  }
};

/// A type if it holds, else another.
template <bool HOLDS, class A, class B>
struct Choice {
  typedef A type;
};
template <class A, class B>
struct Choice<false, A, B> {
  typedef B type;
};

// Sums of this many blocks at once fit the registers.
#if defined(GREYBED_WIDEST)
constexpr int TOGETHER = 16;
#elif defined(GREYBED_WIDE)
constexpr int TOGETHER = 8;
#else
constexpr int TOGETHER = 4;
#endif

/// One layer before its bend, LEFT blocks of neurons from here on: y = x W + b, W (IN, WIDTH).
template <int IN, int WIDTH, int LEFT>
struct Layer {
  static constexpr int NOW = LEFT < TOGETHER ? LEFT : TOGETHER;

  static GREYBED_HOT void run(const double* x, const double* weight, const double* bias, double* y) {
    Sums<NOW> sums;
    sums.get(bias);
#if defined(GREYBED_WIDEST)
    // Two chains: sums of eight are too few to hide how long a product takes.
    Sums<NOW> odd;
    odd.set(0.0);
    for (int i = 0; i + 1 < IN; i += 2) {
      sums.add(weight + WIDTH * i, eight(x[i]));
      odd.add(weight + WIDTH * (i + 1), eight(x[i + 1]));
    }
    if (IN % 2 != 0) sums.add(weight + WIDTH * (IN - 1), eight(x[IN - 1]));
    sums.join(odd);
#else
    for (int i = 0; i < IN; ++i) sums.add(weight + WIDTH * i, eight(x[i]));
#endif
    sums.put(y);
    Layer<IN, WIDTH, LEFT - NOW>::run(x, weight + 4 * NOW, bias + 4 * NOW, y + 4 * NOW);
  }
};
template <int IN, int WIDTH>
struct Layer<IN, WIDTH, 0> {
  static GREYBED_HOT void run(const double*, const double*, const double*, double*) {}
};

/// N numbers, a multiple of four, through the bend of their layer, in place; slopes too if they are wanted. Sixteen at
/// once, for a step waits for the one before it.
template <int N, class Bend, bool SLOPES>
struct Bending {
  typedef typename Choice<(N >= 16), Two<v8>, typename Choice<(N >= 8), v8, v4>::type>::type Lanes;
  static constexpr int NOW = sizeof(Lanes) / sizeof(double);

  static GREYBED_HOT void run(double* x, double* slope) {
    Lanes v;
    Lanes s;
    load(x, v);
    squash<Bend>(v, s);
    store(v, x);
    if (SLOPES) store(s, slope);
    Bending<N - NOW, Bend, SLOPES>::run(x + NOW, SLOPES ? slope + NOW : slope);
  }
};
template <class Bend, bool SLOPES>
struct Bending<0, Bend, SLOPES> {
  static GREYBED_HOT void run(double*, double*) {}
};

/// A layer whose inputs are still to be bent, in place: the steps of four of them go between the products of those
/// before, for a step waits for the one before it, and processors look ahead too little to fill that time.
template <int IN, int WIDTH, int LEFT, class Bend, bool SLOPES>
struct BentLayer {
  static constexpr int NOW = LEFT < TOGETHER ? LEFT : TOGETHER;
  static constexpr int AHEAD = IN < 8 ? IN : 8;

  static GREYBED_HOT void run(double* x, double* slope, const double* weight, const double* bias, double* y) {
    Bending<AHEAD, Bend, SLOPES>::run(x, slope);
    Sums<NOW> sums;
    sums.get(bias);
    for (int i = 0; i < IN - AHEAD; i += 4) {
      typename Bend::template Steps<v4> steps;
      load(x + AHEAD + i, steps.x);
      const double* const w = weight + WIDTH * i;
      steps.first();
      sums.add(w, eight(x[i]));
      steps.second();
      sums.add(w + WIDTH, eight(x[i + 1]));
      steps.third();
      sums.add(w + 2 * WIDTH, eight(x[i + 2]));
      steps.fourth();
      sums.add(w + 3 * WIDTH, eight(x[i + 3]));
      store(steps.x, x + AHEAD + i);
      if (SLOPES) store(steps.slope, slope + AHEAD + i);
    }
    for (int i = IN - AHEAD; i < IN; ++i) sums.add(weight + WIDTH * i, eight(x[i]));
    sums.put(y);
    Layer<IN, WIDTH, LEFT - NOW>::run(x, weight + 4 * NOW, bias + 4 * NOW, y + 4 * NOW);
  }
};

/// N numbers brought between -20 and 20, where tanh rounds to -1 and 1.
template <int N>
GREYBED_DEVICE inline void hold(double* x) {
  for (int k = 0; k < N; ++k) x[k] = x[k] < -20.0 ? -20.0 : (x[k] > 20.0 ? 20.0 : x[k]);
}

/// Dot product of arrays of length 4 B.
template <int B>
GREYBED_HOT double dot(const double* x, const double* y) {
  Sums<B> all;
  all.get(x);
  return all.dot(y);
}

/// K rows of sums: for the derivatives of K values at once, whose shares lie WIDTH apart.
template <int K, int B, int WIDTH>
struct Fan {
  Sums<B> head;
  Fan<K - 1, B, WIDTH> rest;

  GREYBED_HOT void set(double x) {
    head.set(x);
    rest.set(x);
  }
  GREYBED_HOT void add(const double* p, const double* x) {
    head.add(p, eight(*x));
    rest.add(p, x + WIDTH);
  }
  GREYBED_HOT void put(double* p, int apart) const {
    head.put(p);
    rest.put(p + apart, apart);
  }
  GREYBED_HOT void put_scaled(const double* slope, double* p, int apart) {
    head.scale_by(slope);
    head.put(p);
    rest.put_scaled(slope, p + apart, apart);
  }
};
template <int B, int WIDTH>
struct Fan<0, B, WIDTH> {
  GREYBED_HOT void set(double) {}
  GREYBED_HOT void add(const double*, const double*) {}
  GREYBED_HOT void put(double*, int) const {}
  GREYBED_HOT void put_scaled(const double*, double*, int) {}
};
