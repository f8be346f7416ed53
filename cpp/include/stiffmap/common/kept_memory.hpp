// SPDX-License-Identifier: MIT
// Memory of answers, kept for the next call when its arrays are gone: fresh pages cost more than a pose.
#pragma once

#include <cstdlib>
#include <map>
#include <new>

namespace stiffmap {

/// Pieces that no array holds any more. Not for two threads at once: the interpreter's lock is held.
class KeptMemory {
 public:
  static constexpr std::size_t grain = 1 << 16, least = 1 << 16, most_each = 1 << 24, most_kept = 1 << 26;
  struct Piece {
    void* memory;
    std::size_t bytes;
  };

  /// Whether it pays to keep so many bytes.
  static bool keeps(std::size_t bytes) { return bytes >= least && bytes <= most_each; }

  /// Never destroyed: arrays may outlive everything else.
  static KeptMemory& all() {
    static KeptMemory* const kept = new KeptMemory;
    return *kept;
  }

  /// The smallest that fits and is not much too large.
  Piece* take(std::size_t wanted) {
    const std::size_t bytes = (wanted + grain - 1) / grain * grain;
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

 private:
  std::multimap<std::size_t, Piece*> free_;
  std::size_t kept_ = 0;
};

}  // namespace stiffmap
