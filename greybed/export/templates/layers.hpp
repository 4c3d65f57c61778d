{# Layers of a network with all sums in registers, whatever the compiler makes of loops. #}
/// B blocks of four sums.
template <int B>
struct Sums {
  v4 head;
  Sums<B - 1> rest;

  GREYBED_HOT void set(double x) {
    spread(x, head);
    rest.set(x);
  }
  GREYBED_HOT void get(const double* p) {
    load(p, head);
    rest.get(p + 4);
  }
  GREYBED_HOT void put(double* p) const {
    store(head, p);
    rest.put(p + 4);
  }
  /// += p x
  GREYBED_HOT void add(const double* p, const v4& x) {
    v4 w;
    load(p, w);
    add_product(head, w, x);
    rest.add(p + 4, x);
  }
  GREYBED_HOT void scale_by(const double* p) {
    v4 w;
    load(p, w);
    head = head * w;
    rest.scale_by(p + 4);
  }
  /// = s x + t y
  GREYBED_HOT void mix(const Sums& x, const v4& s, const Sums& y, const v4& t) {
    head = x.head * s + y.head * t;
    rest.mix(x.rest, s, y.rest, t);
  }
  /// = s x
  GREYBED_HOT void scaled(const Sums& x, const v4& s) {
    head = x.head * s;
    rest.scaled(x.rest, s);
  }
  /// Through the bend of a layer, to memory; slopes too unless there is no place for them.
  template <class Bend, bool SLOPES>
  GREYBED_HOT void squash(double* value, double* slope) {
    // Two blocks side by side: neither waits for the other.
    Two<v4> x = {head, rest.head};
    Two<v4> s;
    Bend::squash(x, s);
    store(x, value);
    if (SLOPES) store(s, slope);
    rest.rest.template squash<Bend, SLOPES>(value + 8, SLOPES ? slope + 8 : slope);
  }
  /// Dot product with p.
  GREYBED_HOT v4 dot(const double* p) const {
    v4 w;
    load(p, w);
    return head * w + rest.dot(p + 4);
  }
};
template <>
struct Sums<0> {
  GREYBED_HOT void set(double) {}
  GREYBED_HOT void get(const double*) {}
  GREYBED_HOT void put(double*) const {}
  GREYBED_HOT void add(const double*, const v4&) {}
  GREYBED_HOT void scale_by(const double*) {}
  GREYBED_HOT void mix(const Sums&, const v4&, const Sums&, const v4&) {}
  GREYBED_HOT void scaled(const Sums&, const v4&) {}
  template <class Bend, bool SLOPES>
  GREYBED_HOT void squash(double*, double*) {}
  GREYBED_HOT v4 dot(const double*) const { return four(0.0); }
};
/// One block: the end of a row of an odd number of blocks.
template <>
struct Sums<1> {
  v4 head;
  Sums<0> rest;

  GREYBED_HOT void set(double x) { spread(x, head); }
  GREYBED_HOT void get(const double* p) { load(p, head); }
  GREYBED_HOT void put(double* p) const { store(head, p); }
  GREYBED_HOT void add(const double* p, const v4& x) {
    v4 w;
    load(p, w);
    add_product(head, w, x);
  }
  GREYBED_HOT void scale_by(const double* p) {
    v4 w;
    load(p, w);
    head = head * w;
  }
  GREYBED_HOT void mix(const Sums& x, const v4& s, const Sums& y, const v4& t) {
    head = x.head * s + y.head * t;
  }
  GREYBED_HOT void scaled(const Sums& x, const v4& s) { head = x.head * s; }
  template <class Bend, bool SLOPES>
  GREYBED_HOT void squash(double* value, double* slope) {
    v4 s;
    Bend::squash(head, s);
    store(head, value);
    if (SLOPES) store(s, slope);
  }
  GREYBED_HOT v4 dot(const double* p) const {
    v4 w;
    load(p, w);
    return head * w;
  }
};
// Sums of this many blocks at once fit the registers.
#if defined(__AVX__) || defined(GREYBED_AVX2)
constexpr int TOGETHER = 8;
#else
constexpr int TOGETHER = 4;
#endif

/// One layer, LEFT blocks of its neurons from here on: y = bend(x W + b), W (IN, WIDTH).
template <int IN, int WIDTH, int LEFT, class Bend, bool SLOPES>
struct Layer {
  static constexpr int NOW = LEFT < TOGETHER ? LEFT : TOGETHER;

  static GREYBED_HOT void run(const double* x, const double* weight, const double* bias, double* y,
                              double* slope) {
    Sums<NOW> sums;
    sums.get(bias);
    for (int i = 0; i < IN; ++i) sums.add(weight + WIDTH * i, four(x[i]));
    sums.template squash<Bend, SLOPES>(y, slope);
    Layer<IN, WIDTH, LEFT - NOW, Bend, SLOPES>::run(x, weight + 4 * NOW, bias + 4 * NOW,
                                                    y + 4 * NOW, SLOPES ? slope + 4 * NOW : slope);
  }
};
template <int IN, int WIDTH, class Bend, bool SLOPES>
struct Layer<IN, WIDTH, 0, Bend, SLOPES> {
  static GREYBED_HOT void run(const double*, const double*, const double*, double*, double*) {}
};

/// Dot product of arrays of length 4 B.
template <int B>
GREYBED_HOT double dot(const double* x, const double* y) {
  Sums<B> all;
  all.get(x);
  return total(all.dot(y));
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
    head.add(p, four(*x));
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
