// SPDX-License-Identifier: MIT
// Memory of answers, kept for the next call when its arrays are gone: fresh pages cost more than a pose.
#pragma once

#include <cstdlib>
#include <map>
#include <new>

#include "arrays.hpp"

namespace stiffmap::bindings {

/// Pieces that no array holds any more. Only used with the interpreter's lock held.
class KeptMemory {
 public:
  /// A new array of `shape`, not filled.
  template <class T>
  static py::array_t<T> array(const std::vector<py::ssize_t>& shape) {
    std::size_t bytes = sizeof(T);
    for (const py::ssize_t n : shape) bytes *= static_cast<std::size_t>(n);
    if (bytes < least || bytes > most_each) return py::array_t<T>(shape);
    Piece* const piece = all().take((bytes + grain - 1) / grain * grain);
    return py::array_t<T>(shape, static_cast<T*>(piece->memory),
                          py::capsule(piece, [](void* p) { all().give(static_cast<Piece*>(p)); }));
  }

 private:
  static constexpr std::size_t grain = 1 << 16, least = 1 << 16, most_each = 1 << 24, most_kept = 1 << 26;
  struct Piece {
    void* memory;
    std::size_t bytes;
  };

  /// Never destroyed: arrays may outlive everything else.
  static KeptMemory& all() {
    static KeptMemory* const kept = new KeptMemory;
    return *kept;
  }

  /// The smallest that fits and is not much too large.
  Piece* take(std::size_t bytes) {
    const auto found = free_.lower_bound(bytes);
    if (found != free_.end() && found->first <= bytes + bytes / 4) {
      Piece* const piece = found->second;
      free_.erase(found);
      kept_ -= piece->bytes;
      return piece;
    }
    void* const memory = std::aligned_alloc(grain, bytes);
    if (!memory) throw std::bad_alloc();
    return new Piece{memory, bytes};
  }

  void give(Piece* piece) {
    if (kept_ + piece->bytes > most_kept) {
      std::free(piece->memory);
      delete piece;
      return;
    }
    kept_ += piece->bytes;
    free_.emplace(piece->bytes, piece);
  }

  std::multimap<std::size_t, Piece*> free_;
  std::size_t kept_ = 0;
};

}  // namespace stiffmap::bindings
